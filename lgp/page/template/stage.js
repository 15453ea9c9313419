// The scene of a plan in WebGL: `new Stage(plan.view)` shows it at any time, from any side.
"use strict";

const PAPER = [1200, 750]; // width and height of a picture [px]

class Stage {
  constructor(view) {
    this.view = view;
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.outputEncoding = THREE.sRGBEncoding;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.canvas = this.renderer.domElement;
    this.canvas.setAttribute("role", "img");
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(view.angle, 1, 0.05, 60);
    this.camera.up.set(0, 0, 1);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.controls.maxPolarAngle = 0.53 * Math.PI;
    this.controls.minDistance = 0.4;
    this.controls.maxDistance = 14;
    this.time = 0;
    this.shot = 0;
    this.positions = lengths(view.position);
    this.rotations = new Int16Array(bytes(view.rotation));
    this.frames = view.frames.map(() => new THREE.Object3D());
    this.frames.forEach((frame) => this.scene.add(frame));
    this.addBodies();
    this.addLight();
    this.addRing();
    this.setTime(0);
    this.aim(0);
  }

  // A ring around the object of an action, drawn over all bodies.
  addRing() {
    const look = { color: linear(0xf0, 0x8a, 0x24), transparent: true, opacity: 0.9, depthTest: false, depthWrite: false };
    this.ring = new THREE.Mesh(new THREE.RingGeometry(0.93, 1, 64), new THREE.MeshBasicMaterial(look));
    this.ring.renderOrder = 1;
    this.scene.add(this.ring);
    this.mark(null);
  }

  // Draw the ring around a frame (its number) with a radius [m]; null hides it.
  mark(frame, radius = 0.1) {
    this.marked = frame;
    this.ring.visible = frame !== null;
    this.ring.scale.setScalar(radius);
    this.draw();
  }

  addBodies() {
    const meshes = this.view.meshes.map((mesh) => ({ geometry: geometry(mesh), material: material(mesh) }));
    for (const body of this.view.bodies) {
      const { geometry, material } = meshes[body.mesh];
      const mesh = new THREE.Mesh(geometry, material);
      mesh.matrixAutoUpdate = false;
      mesh.matrix.fromArray(body.place);
      mesh.castShadow = mesh.receiveShadow = true;
      (body.frame === null ? this.scene : this.frames[body.frame]).add(mesh);
    }
    for (const skin of this.view.skins) this.addSkin(skin);
  }

  addSkin(skin) {
    const shape = geometry(skin.mesh);
    shape.setAttribute("skinIndex", new THREE.BufferAttribute(new Uint8Array(bytes(skin.index)), 4));
    const weight = Float32Array.from(new Uint8Array(bytes(skin.weight)), (value) => value / 255);
    shape.setAttribute("skinWeight", new THREE.BufferAttribute(weight, 4));
    const mesh = new THREE.SkinnedMesh(shape, material(skin.mesh));
    mesh.normalizeSkinWeights();
    mesh.frustumCulled = false;
    mesh.castShadow = mesh.receiveShadow = true;
    const bones = skin.frames.map((number) => {
      const bone = new THREE.Bone();
      this.frames[number].add(bone);
      return bone;
    });
    const inverse = skin.inverse.map((values) => new THREE.Matrix4().fromArray(values));
    this.scene.add(mesh);
    mesh.bind(new THREE.Skeleton(bones, inverse), new THREE.Matrix4());
  }

  // A key light that casts shadows, daylight from above, and a floor that fades into the page.
  addLight() {
    const box = new THREE.Box3();
    for (const shot of this.view.shots) points(shot).forEach((point) => box.expandByPoint(point));
    const middle = box.getCenter(new THREE.Vector3());
    const size = box.getSize(new THREE.Vector3()).length();
    const sky = new THREE.HemisphereLight(0xffffff, 0xb3aca4, 0.66);
    sky.position.set(0, 0, 1);
    this.scene.add(sky);
    this.key = new THREE.DirectionalLight(0xfff6ea, 0.5);
    this.key.target.position.copy(middle).setZ(0.6);
    this.key.castShadow = true;
    this.key.shadow.mapSize.set(2048, 2048);
    Object.assign(this.key.shadow.camera, { left: -size, right: size, top: size, bottom: -size, near: 0.1, far: 20 });
    this.key.shadow.bias = -0.0006;
    this.key.shadow.normalBias = 0.012;
    this.key.shadow.radius = 3;
    this.key.position.copy(this.key.target.position).add(new THREE.Vector3(1.4, -2.2, 5.5));
    const fill = new THREE.DirectionalLight(0xe8f0ff, 0.22);
    fill.position.set(-3, 3, 2.5);
    this.scene.add(this.key, this.key.target, fill);
    const floor = new THREE.Mesh(
      new THREE.CircleGeometry(0.85 * size, 72),
      new THREE.MeshLambertMaterial({ alphaMap: fade(), transparent: true }),
    );
    this.floor = floor;
    this.tint();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.tint();
      this.draw();
    });
    floor.position.set(middle.x, middle.y, -0.004);
    floor.receiveShadow = true;
    this.scene.add(floor);
  }

  // The floor is as light or as dark as the page, or has a colour.
  tint(colour = getComputedStyle(document.documentElement).getPropertyValue("--floor").trim()) {
    this.floor.material.color.set(colour).convertSRGBToLinear();
  }

  // Show a moment [s].
  setTime(time) {
    const moments = this.view.time;
    const last = moments.length - 1;
    this.time = Math.min(Math.max(time, 0), moments[last]);
    const upper = Math.min(Math.max(moments.findIndex((moment) => moment >= this.time), 1), last);
    const share = (this.time - moments[upper - 1]) / (moments[upper] - moments[upper - 1]);
    const count = this.frames.length;
    const [first, second] = [new THREE.Quaternion(), new THREE.Quaternion()];
    this.frames.forEach((frame, number) => {
      const [from, to] = [(upper - 1) * count + number, upper * count + number];
      frame.position.fromArray(this.positions, 3 * from);
      frame.position.lerp(new THREE.Vector3().fromArray(this.positions, 3 * to), share);
      first.fromArray(this.rotations, 4 * from).normalize();
      second.fromArray(this.rotations, 4 * to).normalize();
      frame.quaternion.copy(first.slerp(second, share));
    });
    this.draw();
  }

  // Look at a shot, at once or in a turn that takes some seconds.
  aim(shot, seconds = 0) {
    this.shot = shot;
    const goal = framed(points(this.view.shots[shot]), this.view.shots[shot].towards, this.camera.aspect, this.view);
    if (!seconds) {
      this.look(goal.target, goal.eye);
      return;
    }
    const [target, eye] = [this.controls.target.clone(), this.camera.position.clone()];
    const start = performance.now();
    const turn = (this.turn = {});
    const step = (now) => {
      if (this.turn !== turn) return;
      const share = Math.min((now - start) / (1000 * seconds), 1);
      const eased = share * share * (3 - 2 * share);
      const at = target.clone().lerp(goal.target, eased);
      this.look(at, around(target, eye, goal, eased).add(at));
      if (share < 1) requestAnimationFrame(step);
      else this.turn = null;
    };
    requestAnimationFrame(step);
  }

  look(target, eye) {
    this.controls.target.copy(target);
    this.camera.position.copy(eye);
    this.controls.update();
    this.draw();
  }

  fit(figure) {
    const { clientWidth: width, clientHeight: height } = figure;
    if (!width || !height) return;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height, false);
    this.aim(this.shot);
  }

  draw() {
    if (this.wanted) return;
    this.wanted = true;
    requestAnimationFrame(() => {
      this.wanted = false;
      this.render();
    });
  }

  render() {
    if (this.marked !== null) this.ring.position.copy(this.frames[this.marked].position);
    this.ring.quaternion.copy(this.camera.quaternion);
    this.renderer.render(this.scene, this.camera);
  }

  // A picture of a moment [s] for paper, as a canvas of its own; what is on the screen has to be shown again.
  picture(shot, time, doing) {
    const [width, height] = PAPER;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height, false);
    this.tint("#dfe4e8");
    this.turn = null;
    this.setTime(time);
    this.mark(doing ? doing.frame : null, doing && doing.radius);
    this.aim(shot);
    this.render();
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = PAPER;
    copy.getContext("2d").drawImage(this.canvas, 0, 0, width, height);
    this.tint();
    return copy;
  }
}

// The nearest eye with all points in the picture: `framed` of lgp/page/camera.py.
function framed(seen, direction, aspect, { angle, room, nearest }) {
  const towards = new THREE.Vector3().fromArray(direction);
  const right = new THREE.Vector3(0, 0, 1).cross(towards).normalize();
  const up = towards.clone().cross(right);
  const tall = Math.tan((angle * Math.PI) / 360);
  const near = seen.map((point) => point.dot(towards));
  const [across, above] = [right, up].map((axis) => seen.map((point) => point.dot(axis)));
  const needed = (offsets, slope) => {
    const high = Math.max(...offsets.map((value, number) => value + slope * near[number]));
    const low = Math.min(...offsets.map((value, number) => value - slope * near[number]));
    return (high - low) / (2 * slope);
  };
  const centre = near.reduce((sum, value) => sum + value, 0) / near.length;
  const enough = Math.max(needed(across, tall * aspect), needed(above, tall));
  const away = Math.max(centre + room * (enough - centre), Math.max(...near) + nearest);
  const depth = near.map((value) => away - value);
  const target = right.multiplyScalar(middle(across, depth)).addScaledVector(up, middle(above, depth));
  target.addScaledVector(towards, centre);
  return { target, eye: target.clone().addScaledVector(towards, away - centre) };
}

// The offset of the eye for which the outermost two points are at equal angles from the axis.
function middle(offsets, depth) {
  let centre = (Math.max(...offsets) + Math.min(...offsets)) / 2;
  for (let round = 0; round < 8; round += 1) {
    const seen = offsets.map((value, number) => (value - centre) / depth[number]);
    const [high, low] = [seen.indexOf(Math.max(...seen)), seen.indexOf(Math.min(...seen))];
    centre = (offsets[high] * depth[low] + offsets[low] * depth[high]) / (depth[low] + depth[high]);
  }
  return centre;
}

// The eye relative to the target, on a turn around it: spherical coordinates are interpolated.
function around(target, eye, goal, share) {
  const from = new THREE.Spherical().setFromVector3(swapped(eye.clone().sub(target)));
  const to = new THREE.Spherical().setFromVector3(swapped(goal.eye.clone().sub(goal.target)));
  const turned = Math.atan2(Math.sin(to.theta - from.theta), Math.cos(to.theta - from.theta));
  const mix = (a, b) => a + share * (b - a);
  const here = new THREE.Spherical(mix(from.radius, to.radius), mix(from.phi, to.phi), from.theta + share * turned);
  const eyeNow = new THREE.Vector3().setFromSpherical(here);
  return eyeNow.set(eyeNow.z, eyeNow.x, eyeNow.y);
}

// Spherical coordinates of three.js have y upwards.
const swapped = (vector) => vector.set(vector.y, vector.z, vector.x);

const points = (shot) => {
  const list = [];
  for (let at = 0; at < shot.points.length; at += 3) list.push(new THREE.Vector3().fromArray(shot.points, at));
  return list;
};

const linear = (...rgb) => new THREE.Color(...rgb.map((value) => value / 255)).convertSRGBToLinear();

function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
}

function lengths({ data, scale, middle }) {
  return Float32Array.from(new Int16Array(bytes(data)), (value, number) => value * scale + middle[number % 3]);
}

function geometry(mesh) {
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(lengths(mesh.vertices), 3));
  const faces = mesh.wide ? new Uint32Array(bytes(mesh.faces)) : new Uint16Array(bytes(mesh.faces));
  shape.setIndex(new THREE.BufferAttribute(faces, 1));
  const palette = mesh.palette.map((rgb) => linear(...rgb).toArray());
  const colours = Float32Array.from([...new Uint8Array(bytes(mesh.colours))].flatMap((number) => palette[number]));
  shape.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  shape.computeVertexNormals();
  return shape;
}

function material(mesh) {
  return new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.95 - 0.6 * mesh.gloss, side: THREE.DoubleSide });
}

// White in the middle, black at the rim.
function fade() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 256;
  const pen = canvas.getContext("2d");
  const shade = pen.createRadialGradient(128, 128, 20, 128, 128, 128);
  shade.addColorStop(0, "#fff");
  shade.addColorStop(0.55, "#ddd");
  shade.addColorStop(1, "#000");
  pen.fillStyle = shade;
  pen.fillRect(0, 0, 256, 256);
  return new THREE.CanvasTexture(canvas);
}

// A stage, or null without WebGL: pictures replace it.
function makeStage(view) {
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("webgl2") || canvas.getContext("webgl");
  return context ? new Stage(view) : null;
}
