// The colours that carry meaning: the same in the scene and in the panel, and those of the Rerun view.

const rgb = (r, g, b) => [r / 255, g / 255, b / 255];

export const SIDES = { left: rgb(74, 144, 226), right: rgb(240, 140, 58) };
export const STATES = {
  tracked: rgb(76, 190, 120), inferred: rgb(240, 205, 70), held: rgb(226, 80, 150), lost: rgb(120, 126, 138),
};
export const SKIN = rgb(226, 186, 160);
export const SHIRT = rgb(176, 184, 196);
export const HEADSET = rgb(44, 48, 56);
export const VISOR = rgb(74, 88, 110);
export const CONTROLLER = rgb(238, 240, 246);
export const STALE = rgb(134, 138, 148);
export const BACKGROUND = rgb(24, 27, 34);

export const css = (colour) => `rgb(${colour.map((part) => Math.round(255 * part)).join(" ")})`;
