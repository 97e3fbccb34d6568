// What is drawn of a person: a list of parts { name, mesh, matrix, colour }, from the service's answer and the own poses.

import { SPANS } from "./body.js";
import { add, poseMatrix, rotate, spanMatrix } from "./math.js";
import * as palette from "./palette.js";

const NECK_ROOT = [0, 0.06, 0.004]; // in the chest frame
const SKULL_BASE = [0, -0.085, 0.075]; // in the VIEW frame
const GIRDLE_ROOT = [0.035, 0.045, 0.002]; // right side, in the chest frame
const VALID = 3;

const inFrame = (pose, point) => add(pose.position, rotate(pose.orientation, point));
const posed = (name, mesh, pose, colour) => ({ name, mesh, matrix: poseMatrix(pose.position, pose.orientation), colour });
const span = (name, mesh, start, end, colour) => ({ name, mesh, matrix: spanMatrix(start, end, SPANS[mesh]), colour });

function armParts(side, arm, chest, stale) {
  const { upper_arm, forearm, hand } = arm.bones;
  const sleeve = stale ? palette.STALE : palette.SIDES[side];
  const skin = stale ? palette.STALE : arm.tracking === "tracked" ? palette.SKIN : palette.STATES[arm.tracking];
  const [x, y, z] = GIRDLE_ROOT;
  const root = inFrame(chest, [side === "left" ? -x : x, y, z]);
  return [
    span(`${side} girdle`, "girdle", root, upper_arm.position, palette.SHIRT),
    posed(`${side} upper_arm`, `${side} upper_arm`, upper_arm, sleeve),
    posed(`${side} forearm`, `${side} forearm`, forearm, sleeve),
    posed(`${side} wrist`, "wrist", hand, skin),
    posed(`${side} hand`, `${side} hand`, hand, skin),
  ];
}

function trunkParts(state) {
  const { chest, head } = state;
  return [
    posed("torso", "torso", chest, palette.SHIRT),
    span("neck", "neck", inFrame(chest, NECK_ROOT), inFrame(head, SKULL_BASE), palette.SKIN),
    posed("head", "head", head, palette.SKIN),
    posed("headset", "headset", head, palette.HEADSET),
    posed("visor", "visor", head, palette.VISOR),
  ];
}

// `state` is an ArmsState or null, `poses` what was sampled last. The wearer does not see the own head and trunk.
export function figureParts(state, poses, { worn, stale }) {
  const parts = [];
  if (state) {
    for (const side of ["left", "right"]) parts.push(...armParts(side, state[side], state.chest, stale));
    if (worn) parts.splice(0, parts.length, ...parts.filter(({ name }) => !name.endsWith("girdle")));
    else parts.push(...trunkParts(state));
  }
  for (const side of ["left", "right"]) {
    const pose = poses?.devices[side];
    if (pose && pose.joint === "grip" && (pose.flags & VALID) === VALID) parts.push(posed(`${side} controller`, "controller", pose, palette.CONTROLLER));
    const aim = worn && poses?.aims[side];
    if (aim) parts.push(span(`${side} aim`, "ray", aim.position, inFrame(aim, [0, 0, -SPANS.ray]), palette.SIDES[side]));
  }
  return parts;
}
