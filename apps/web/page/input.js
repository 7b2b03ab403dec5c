// Pointer, wheel, touch and keys of a canvas, to the camera of its viewer.
//
// One finger or the main button turns; two fingers or another button (or Shift) move sideways, and pinching comes
// closer; the wheel comes closer. W A S D or the arrows walk, Q and E sink and rise, while the canvas has the focus.
//
// Where things may be moved, Alt takes hold of one and moves it over the horizontal plane, with Shift up and down; so
// does a pointer without Alt while the viewer is set to moving.

// A pointer that goes no farther than this only taps, CSS pixels.
const TAP = 4;

const KEYS = {
  KeyW: [1, 0, 0],
  ArrowUp: [1, 0, 0],
  KeyS: [-1, 0, 0],
  ArrowDown: [-1, 0, 0],
  KeyD: [0, 1, 0],
  ArrowRight: [0, 1, 0],
  KeyA: [0, -1, 0],
  ArrowLeft: [0, -1, 0],
  KeyE: [0, 0, 1],
  KeyQ: [0, 0, -1],
};

/** Listens until the function that it gives is called. `hand` moves things; see dapple.js. */
export function attachControls(canvas, core, isAlive, hand) {
  const pointers = new Map();
  const held = new Set();
  // The pointer that holds a thing, and where it took hold.
  let holder = null;
  const height = () => canvas.clientHeight || 1;
  const place = (event) => {
    const { left, top } = canvas.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  };

  const takesHold = (event) => {
    const wants = event.altKey ? hand.mayMove() : hand.moving() !== null && !event.shiftKey;
    return wants && event.button === 0 && pointers.size === 0 && hand.grab(...place(event));
  };

  const down = (event) => {
    if (pointers.size >= 2) return;
    canvas.setPointerCapture(event.pointerId);
    if (isAlive() && takesHold(event)) holder = { id: event.pointerId, x: event.clientX, y: event.clientY, moved: false };
    const sideways = event.button !== 0 || event.shiftKey;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, sideways });
    canvas.focus({ preventScroll: true });
    event.preventDefault();
  };

  const move = (event) => {
    const pointer = pointers.get(event.pointerId);
    if (!pointer || !isAlive()) return;
    if (holder) {
      if (holder.id !== event.pointerId) return;
      // A hand that only taps moves nothing.
      holder.moved ||= Math.hypot(event.clientX - holder.x, event.clientY - holder.y) > TAP;
      if (holder.moved) hand.drag(...place(event), event.altKey ? event.shiftKey : hand.moving() === "upright");
      return;
    }
    const dx = event.clientX - pointer.x;
    const dy = event.clientY - pointer.y;
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const apart = (p) => Math.max(Math.hypot(p.x - other.x, p.y - other.y), 1);
      const before = apart(pointer);
      pointer.x = event.clientX;
      pointer.y = event.clientY;
      core.zoom(apart(pointer) / before);
      // The other finger brings the other half of the way.
      core.pan((0.5 * dx) / height(), (0.5 * dy) / height());
    } else {
      pointer.x = event.clientX;
      pointer.y = event.clientY;
      if (pointer.sideways) core.pan(dx / height(), dy / height());
      else core.rotate(dx / height(), dy / height());
    }
  };

  const up = (event) => {
    pointers.delete(event.pointerId);
    if (holder?.id === event.pointerId) {
      holder = null;
      hand.release();
    }
  };

  const wheel = (event) => {
    if (!isAlive()) return;
    event.preventDefault();
    // Lines and pages of some mice, in pixels.
    const unit = [1, 16, 400][event.deltaMode] ?? 1;
    core.zoom(Math.exp(-0.0015 * unit * event.deltaY));
  };

  const walk = () => {
    const sum = [0, 0, 0];
    for (const code of held) KEYS[code].forEach((step, axis) => (sum[axis] += step));
    core.walk(...sum.map(Math.sign));
  };

  const keyDown = (event) => {
    if (!(event.code in KEYS) || event.ctrlKey || event.metaKey || event.altKey || !isAlive()) return;
    event.preventDefault();
    held.add(event.code);
    walk();
  };

  const keyUp = (event) => {
    if (held.delete(event.code) && isAlive()) walk();
  };

  const leave = () => {
    held.clear();
    if (isAlive()) walk();
  };

  const menu = (event) => event.preventDefault();

  const listeners = [
    ["pointerdown", down],
    ["pointermove", move],
    ["pointerup", up],
    ["pointercancel", up],
    ["wheel", wheel, { passive: false }],
    ["keydown", keyDown],
    ["keyup", keyUp],
    ["blur", leave],
    ["contextmenu", menu],
  ];
  for (const listener of listeners) canvas.addEventListener(...listener);
  const { touchAction } = canvas.style;
  canvas.style.touchAction = "none";
  if (canvas.tabIndex < 0) canvas.tabIndex = 0;
  return () => {
    for (const [type, handler] of listeners) canvas.removeEventListener(type, handler);
    canvas.style.touchAction = touchAction;
  };
}
