// Types and documentation of dapple.js.

/** How visibility is found: points through the atlas, points by the paper's look-up, or not at all. */
export type Method = "psao" | "psao-paper" | "none";

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
  /** `program` (once a page), `scene`, `stream`: bytes fetched. `light`: texels that have their weights. */
  stage: "program" | "scene" | "stream" | "light";
  loaded: number;
  /** null where the server does not say. */
  total: number | null;
}

export interface Stats {
  /** Pictures drawn a second; a still scene is not drawn again. */
  fps: number;
  /** Of the stream that is replayed, over the last two seconds. */
  megabitsPerSecond: number;
  /** Points whose visibility changed, a second. */
  changedPerSecond: number;
  /** Bytes and frames of the stream since the start. */
  bytes: number;
  frames: number;
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
  /** Time of the scene, and where it begins again (0 for never), seconds. */
  time: number;
  duration: number;
  playing: boolean;
  /** Why the chosen method cannot show the points, so that the scene is drawn without occlusion; null where it can. */
  problem: string | null;
}

export interface Options {
  /** Address of a self-contained .glb (or .gltf with embedded data, or .obj). */
  scene: string;
  /** Address of its recorded stream (.dapple); without it everything is open. It must belong to the same scene. */
  stream?: string;
  /** Default `auto`: WebGPU where it works, else WebGL2. */
  backend?: "auto" | "webgpu" | "webgl2";
  /** Default `psao`. */
  method?: Method;
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
}

/** Neither WebGPU nor WebGL2 is to be had; the message says so to the reader. */
export class NoGraphicsError extends Error {}

export interface Viewer {
  /** Resolves when the whole stream has come and every surface has its light; rejects if the viewer fails before. */
  readonly ready: Promise<void>;
  readonly paused: boolean;
  /** Seconds. */
  readonly time: number;
  /** Seconds; 0 for no end. */
  readonly duration: number;
  readonly stats: Stats;
  /** What the loader mended in the scene. */
  readonly warnings: string[];
  /** Names of the scene's camera paths; the last circles the scene. */
  readonly cameras: string[];
  play(): void;
  pause(): void;
  /** Goes to a time in seconds, as far as the stream has come. */
  seek(time: number): void;
  setLoop(loop: boolean): void;
  setMethod(method: Method): void;
  setView(view: View): void;
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
