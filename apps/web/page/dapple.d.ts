// Types and documentation of dapple.js.

/**
 * Methods that look at the picture alone: they need no server, no stream and no points. Those with `sd-` see hidden surfaces, too, by a stochastic depth map, which
 * WebGL2 cannot make (`stats.problem` says so, and the scene is drawn without occlusion).
 */
export type ScreenMethod =
  | "ssao" | "alchemy" | "sao" | "hbao" | "hbao-plus" | "gtao"
  | "sd-ssao" | "sd-hbao" | "sd-hbao-plus";
/** How visibility is found: points through the atlas, points by the paper's look-up, from the picture alone, or not at all. */
export type Method = "psao" | "psao-paper" | ScreenMethod | "none";

/** What is shown. */
export type View = "beauty" | "visibility" | "normal" | "points" | "texels" | "weights" | "age" | "error";

/** Where the picture is taken from. Right-handed, Y up, metres. */
export interface Camera {
  eye: [number, number, number];
  target: [number, number, number];
  /** Vertical field of view, degrees, 1 to 170; default 50. */
  yfovDegrees?: number;
}

export interface Progress {
  /** `program` (once a page), `scene`, `stream`: bytes fetched (of a live session, of its first light). `light`: texels
   * that have their weights. */
  stage: "program" | "scene" | "stream" | "light";
  loaded: number;
  /** null where the server does not say. */
  total: number | null;
}

export interface Stats {
  /** Pictures drawn a second; a still scene is not drawn again. */
  fps: number;
  /** Of the stream that is replayed or comes live, over the last two seconds. */
  megabitsPerSecond: number;
  /** Points whose visibility changed, a second. */
  changedPerSecond: number;
  /** Bytes and frames of the stream since the start. */
  bytes: number;
  frames: number;
  /** Area lights of which the stream says how much is seen. */
  areaLights: number;
  /** Points of the store, those changed by the last frame, texels of the atlas. */
  points: number;
  changed: number;
  texels: number;
  /** Memory of the light, in the program and on the graphics card, bytes. */
  memoryBytes: number;
  cardBytes: number;
  /** Seconds since the last frame of the stream; null before the first. */
  age: number | null;
  backend: "webgpu" | "webgl2";
  adapter: string;
  /** Pixels of the canvas. */
  width: number;
  height: number;
  /** Time of the scene, and where it begins again (0 for never), seconds; that of a live session is the host's. */
  time: number;
  duration: number;
  playing: boolean;
  /** Why the chosen method cannot be shown, so that the scene is drawn without occlusion; null where it can. */
  problem: string | null;
  /** Of a live session; null without one. */
  live: LiveStatus | null;
}

/** How a live session stands. */
export interface LiveStatus {
  /** `connecting` (for the first time), `live`, `reconnecting` (what came stays in view), `refused` (for good), `closed`. */
  state: "connecting" | "live" | "reconnecting" | "refused" | "closed";
  /** Seconds to the next try while `reconnecting`; null while one is under way, and otherwise. */
  retryIn: number | null;
  /** Why the server said no: `token`, `scene` (another one than was loaded), `version`, `full`, `closing`, `silent`,
   * `too-many`, `replaced`, `malformed`; `address` for one that leads nowhere. null where it said nothing. */
  reason: string | null;
  /** The same for people. */
  message: string | null;
  /** What carries it. */
  transport: "WebTransport" | "WebSocket";
  /** Whether the server has let the viewer in, and whether light ever came. */
  connected: boolean;
  hasLight: boolean;
  /** How much of its first light the server has made, 0 to 1; 0 before it has said so. */
  started: number;
  /** What it may do; null before it was let in. */
  role: "view" | "interact" | null;
  /** Number of this viewer, and how many there are. */
  viewer: number | null;
  viewers: number;
  /** Updates a second, and most bits a second that come (null for as many as there are). */
  hz: number | null;
  bitsPerSecond: number | null;
  /** Seconds since the moment that the newest light shows; null before any came. */
  age: number | null;
  /** Where the time goes, milliseconds: the server's step, waiting there, the network, taking it here. */
  stepMs: number;
  queueMs: number;
  networkMs: number;
  applyMs: number;
  /** Points that wait at the server for rays, or for bits. */
  behind: number;
  /** Version of the scene's state. */
  version: number;
  /** Whether the server has yet to answer what was asked. */
  pending: boolean;
}

/** Where a node stands to its parent. */
export interface Placement {
  translation: [number, number, number];
  /** Unit quaternion x, y, z, w. */
  rotation: [number, number, number, number];
  scale: [number, number, number];
}

/** What was changed of the scene since it was loaded. */
export interface Edits {
  placed: { node: number; placement: Placement }[];
  /** Instances that are not there; spares are among them. */
  removed: number[];
  lights: { light: number; color: [number, number, number]; intensity: number }[];
}

/** Something in the picture. */
export interface Picked {
  instance: number;
  node: number;
  name: string;
  /** The place on its surface in the world, metres. */
  position: [number, number, number];
}

/** A live session over Media over QUIC, as viewer.json names it. */
export interface MoqPlace {
  /** Address of the server or of a relay, `https:`; or `http:` of a relay that tells the hash of its certificate there. */
  url: string;
  /** Name of the server's broadcast. */
  name: string;
  /** SHA-256 of its certificate, in hexadecimal, where no authority vouches for it. */
  certificate?: string;
}

export interface Options {
  /** Address of a self-contained .glb (or .gltf with embedded data, or .obj). */
  scene: string;
  /** Address of its recorded stream (.dapple); without it everything is open. It must belong to the same scene. */
  stream?: string;
  /** Address of a live session of the scene instead (`dapple serve`), `ws:` or `wss:` by the page's own scheme. `time`,
   * `loop` and `paused` mean nothing then: time is everyone's. */
  live?: string;
  /** Where the same session is over WebTransport, which is used where the browser has it, before `live`. A function is asked before each connection: a server
   * that has started again is found by another name. */
  moq?: MoqPlace | (() => MoqPlace | null | Promise<MoqPlace | null>);
  /** Default `auto`: WebTransport where there is such, else a WebSocket. */
  transport?: "auto" | "websocket";
  /** What gives the viewer its role, where the server asks for that. */
  token?: string;
  /** Most bits of light a second, on average over seconds, without the first light. Default: as many as there are. */
  bits?: number;
  /** The animation that plays, by its index. Default: the file's first. */
  animation?: number;
  /** So many more that there may be of instances, as the server has them. Default none. */
  spares?: { instance: number; count: number }[];
  /** Default `auto`: WebGPU where it works, else WebGL2. */
  backend?: "auto" | "webgpu" | "webgl2";
  /** Default `psao`. */
  method?: Method;
  /** What stands in for points while there are none: before the first light, or where none ever comes. Default `none`: everything is open. */
  fallback?: ScreenMethod | "none";
  /** Of methods that look at the picture alone: how far away what blocks may be, metres. Default 0.6. */
  radius?: number;
  /** Of the same: how far beyond the picture they look, as a part of its height, 0 to 0.5. Default 0.1. */
  guardBand?: number;
  /** Of the same: how much work they do. Default `high`; `low` and `medium` look at a quarter of the samples. */
  aoPreset?: "low" | "medium" | "high" | "ultra";
  /** Of the same: whether they look at a quarter of the samples. Default: as the preset has it. */
  halfResolution?: boolean;
  /** Of `sd-ssao` and `sd-hbao-plus` (WebGPU): how far to the right a second camera stands, metres, which sees what the first one looks along. Default none. */
  secondCamera?: number;
  /** Whether area lights are drawn where the stream says how much of each is seen (`--area-lights`). Default true. */
  areaLights?: boolean;
  /** Default `beauty`. */
  view?: View;
  /** Another method right of a part (0 to 1) of the width. Default none. */
  split?: { position: number; method: Method };
  /** A name from `cameras`, `fit`, or a place. Default: the scene's first camera. */
  camera?: string | Camera;
  /** Where to begin, seconds. Default 0. */
  time?: number;
  /** Begin again at the end. Default true. */
  loop?: boolean;
  /** Default false. */
  paused?: boolean;
  /** Seconds that an update fades in over, 0 to 10. Default: as long as updates are apart, at most half a second. */
  fade?: number;
  /** Pointer, wheel, touch and keys steer the camera. Default true. */
  controls?: boolean;
  /** The canvas takes on the size it has in the page, in pixels of the device. Default true; else call `resize`. */
  autoResize?: boolean;
  /** Most pixels of the device a CSS pixel, with `autoResize`. Default 2. */
  maxPixelRatio?: number;
  /** Texels along a side of shadow maps, 16 to 8192. Default 2048. */
  shadowResolution?: number;
  /** Samples a pixel, 1 or 4. Default 4. */
  samples?: 1 | 4;
  /** Called while things load. */
  onProgress?: (progress: Progress) => void;
  /** Called if the viewer fails after it was created; it is disposed of already. Default: the console. */
  onError?: (error: Error) => void;
  /** Called every `statsInterval` milliseconds (default 500) while the page is visible. */
  onStats?: (stats: Stats) => void;
  statsInterval?: number;
  /** Called when a live session's state or the scene's changes. */
  onLive?: (status: LiveStatus) => void;
  /** Called when something that was asked for changed nothing, with the reason. */
  onRejected?: (message: string) => void;
  /** Called when something in the picture is picked. */
  onPicked?: (picked: Picked) => void;
}

/** Neither WebGPU nor WebGL2 is to be had; the message says so to the reader. */
export class NoGraphicsError extends Error {}

export interface Viewer {
  /** Resolves when the whole stream (of a live session, its first light) has come and every surface has its light; rejects
   * if the viewer fails before. */
  readonly ready: Promise<void>;
  readonly paused: boolean;
  /** Seconds. */
  readonly time: number;
  /** Seconds; 0 for no end. */
  readonly duration: number;
  readonly stats: Stats;
  /** How the live session stands; null without one. */
  readonly live: LiveStatus | null;
  /** What was changed of the scene. */
  readonly edits: Edits;
  /** Whether anything of it differs from the start. */
  readonly isEdited: boolean;
  /** What was picked last, while it is there. */
  readonly picked: Picked | null;
  /** What the loader mended in the scene. */
  readonly warnings: string[];
  /** Names of the scene's camera paths; the last circles the scene. */
  readonly cameras: string[];
  /** Lets time run, or stand still; in a live session for everyone, as everything from here to `reset`. Throws where the
   * viewer may only look, or has no connection. */
  play(): void;
  pause(): void;
  /** Goes to a time in seconds, as far as the stream has come. */
  seek(time: number): void;
  /** Places a node; what is left out stays as it is. */
  moveNode(node: number, placement: Partial<Placement>): void;
  /** Leaves a node again to the file and its animation. */
  releaseNode(node: number): void;
  removeInstance(instance: number): void;
  restoreInstance(instance: number): void;
  /** Another instance like one, from those that are not there; beside it if no place is given. */
  addInstance(like: number, placement?: Partial<Placement>): void;
  /** How a light shines: linear RGB, and candela (lux if it is directional); null as in the file. */
  setLight(light: number, setting: { color: [number, number, number]; intensity: number } | null): void;
  /** Everything as at first. */
  reset(): void;
  /** What is seen at a place of the canvas, in CSS pixels from its top left corner. */
  pick(x: number, y: number): Picked | null;
  /** Where a node stands now; null if there is no such node. */
  getPlacement(node: number): Placement | null;
  /** Whether there is an instance like this one left to add. */
  canAdd(like: number): boolean;
  /** Lets a pointer move things over the horizontal plane, or up and down, instead of turning the camera; null ends that.
   * With Alt (and Shift) it does so always. */
  setMoving(way: "across" | "upright" | null): void;
  setLoop(loop: boolean): void;
  setMethod(method: Method): void;
  setView(view: View): void;
  setAreaLights(on: boolean): void;
  /** Another method (default `none`) right of a part of the width; null for one method all over. */
  setSplit(position: number | null, method?: Method): void;
  /** Follows a camera path by name, shows all (`fit`), or looks from a place. */
  setCamera(camera: string | Camera): void;
  /** Where the picture is taken from now; `path` is the name of the camera path that is followed, or null. */
  getCamera(): Required<Camera> & { path: string | null; walking: boolean };
  /** On foot (true), or around what is in front. */
  setWalking(walking: boolean): void;
  /** Turns as a pointer does that goes right and down by so many heights of the picture. */
  rotate(dx: number, dy: number): void;
  /** Moves sideways likewise. */
  pan(dx: number, dy: number): void;
  /** Comes closer (above 1) or goes back (below 1). */
  zoom(factor: number): void;
  /** The picture as a file. */
  screenshot(type?: string): Promise<Blob>;
  /** Size of the canvas in pixels of the device, where `autoResize` is false. */
  resize(width: number, height: number): void;
  /** Stops and frees everything. The canvas cannot be used for another backend afterwards. */
  dispose(): void;
}

/** Shows a scene and its light in a canvas. Resolves when the scene is there; the light follows (`ready`). Rejects with
 * a message for the reader. */
export function createViewer(canvas: HTMLCanvasElement, options: Options): Promise<Viewer>;
