// Poses of a WebXR session, as the bridge takes them.

// XrSpaceLocationFlags: what a pose says of itself. An emulated position is inferred, not tracked.
const VALID = 3;
const ORIENTATION_TRACKED = 4;
const POSITION_TRACKED = 8;
const LOST = { position: [0, 0, 0], orientation: [0, 0, 0, 1], flags: 0 };

const vector = (v) => (v ? [v.x, v.y, v.z] : null);

function pagePose(pose, joint) {
  if (!pose) return { ...LOST, joint };
  const { position: p, orientation: q } = pose.transform;
  return {
    position: [p.x, p.y, p.z],
    orientation: [q.x, q.y, q.z, q.w],
    flags: VALID | ORIENTATION_TRACKED | (pose.emulatedPosition ? 0 : POSITION_TRACKED),
    linear_velocity: vector(pose.linearVelocity),
    angular_velocity: vector(pose.angularVelocity),
    joint,
  };
}

// A controller by its grip; a bare hand by its wrist joint, which every browser places alike.
function handPose(frame, source, space) {
  const wrist = source.hand?.get("wrist");
  if (wrist) return pagePose(frame.getJointPose(wrist, space), "wrist");
  return pagePose(source.gripSpace && frame.getPose(source.gripSpace, space), "grip");
}

export class XrSource {
  session = null;
  #space = null;
  #spaceName = "local_floor";

  static async supported() {
    return Boolean(await navigator.xr?.isSessionSupported("immersive-vr").catch(() => false));
  }

  // Ask for the session; only from a click. `gl` becomes usable for it.
  async enter(gl) {
    const session = await navigator.xr.requestSession("immersive-vr", {
      optionalFeatures: ["local-floor", "hand-tracking"],
    });
    await gl.makeXRCompatible();
    session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl, { stencil: true }), depthNear: 0.03 });
    try {
      this.#space = await session.requestReferenceSpace("local-floor");
      this.#spaceName = "local_floor";
    } catch {
      this.#space = await session.requestReferenceSpace("local");
      this.#spaceName = "local";
    }
    session.addEventListener("end", () => (this.session = null));
    this.session = session;
    return session;
  }

  // What a frame of the session shows: poses, aims, views, and the moment they are of.
  sample(time, frame) {
    const viewer = frame.getViewerPose(this.#space);
    const devices = { head: viewer ? pagePose(viewer, "grip") : null, left: null, right: null };
    const aims = {};
    for (const source of frame.session.inputSources) {
      const side = source.handedness;
      if ((side !== "left" && side !== "right") || devices[side]) continue;
      devices[side] = handPose(frame, source, this.#space);
      const aim = frame.getPose(source.targetRaySpace, this.#space);
      if (aim) aims[side] = pagePose(aim, "grip");
    }
    return { space: this.#spaceName, devices, aims, views: viewer?.views ?? [], sampleMs: frame.predictedDisplayTime ?? time };
  }
}
