"use strict";
// The figure of the person that follows the cursor: the joints of reba/posture/skeleton.py, turned by dragging.
const Person = (() => {
  const turn = (axis, degrees) => {
    const a = (degrees * Math.PI) / 180, i = (axis + 1) % 3, j = (axis + 2) % 3;
    const m = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    m[i][i] = m[j][j] = Math.cos(a);
    m[i][j] = -Math.sin(a);
    m[j][i] = Math.sin(a);
    return m;
  };
  const apply = (m, v) => m.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
  const times = (a, b) => a.map((row) => [0, 1, 2].map((k) => row[0] * b[0][k] + row[1] * b[1][k] + row[2] * b[2][k]));
  const add = (a, b, share = 1) => a.map((value, k) => value + share * b[k]);
  const mix = (a, x, b, y) => a.map((value, k) => x * value + y * b[k]);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const column = (m, k) => [m[0][k], m[1][k], m[2][k]];
  const { sin, cos } = Math;

  // Returns joint centers: x forward, y up, z right, stature 1, the middle of the hips at 0.
  function joints(model, angles, sitting) {
    const L = model.lengths;
    const angle = (name) => {
      const k = model.columns.indexOf(name);
      return Number.isNaN(angles[k]) ? model.neutral[k] : angles[k];
    };
    const radians = (name) => (angle(name) * Math.PI) / 180;
    const frame = (part) =>
      times(times(turn(2, -angle(`${part}_flexion`)), turn(0, angle(`${part}_side_bend`))), turn(1, angle(`${part}_twist`)));
    const trunk = frame("trunk"), head = times(trunk, frame("neck"));
    const at = { hip: [0, 0, 0], chest: column(trunk, 1).map((v) => v * L.trunk * 0.55) };
    at.neck = column(trunk, 1).map((v) => v * L.trunk);
    at.head = add(at.neck, column(head, 1), L.neck + L.head / 2);
    at.nose = add(at.head, column(head, 0), L.head * 0.62);
    for (const [side, outward] of [["left", -1], ["right", 1]]) {
      const raised = (Math.min(Math.max(angle(`shoulder_elevation_${side}`), -20), 45) * Math.PI) / 180;
      const half = L.shoulders / 2;
      const across = [0, sin(raised) * half - 0.03, outward * cos(raised) * half];
      const flex = radians(`upper_arm_flexion_${side}`), abduct = radians(`upper_arm_abduction_${side}`);
      const elbow = radians(`lower_arm_flexion_${side}`), bend = radians(`wrist_flexion_${side}`);
      const deviate = radians(`wrist_deviation_${side}`), twist = radians(`wrist_twist_${side}`);
      const arm = [cos(abduct) * sin(flex), -cos(abduct) * cos(flex), outward * sin(abduct)];
      const front = [cos(flex), sin(flex), 0];
      const forearm = mix(arm, cos(elbow), front, sin(elbow));
      const first = mix(front, cos(elbow), arm, -sin(elbow));
      const inward = cross(arm, front).map((v) => -outward * v);
      const palm = mix(inward, cos(twist), first, -sin(twist));
      const thumb = mix(first, cos(twist), inward, sin(twist));
      const hand = mix(mix(forearm, cos(deviate), thumb, -sin(deviate)), cos(bend), palm, sin(bend));
      at[`shoulder_${side}`] = add(at.neck, apply(trunk, across));
      at[`elbow_${side}`] = add(at[`shoulder_${side}`], apply(trunk, arm), L.upper_arm);
      at[`wrist_${side}`] = add(at[`elbow_${side}`], apply(trunk, forearm), L.forearm);
      at[`hand_${side}`] = add(at[`wrist_${side}`], apply(trunk, hand), L.hand);
      const knee = radians(`knee_flexion_${side}`);
      const thigh = sitting ? Math.PI / 2 : 0.6 * knee, shank = sitting ? 0 : -0.4 * knee;
      at[`hip_${side}`] = [0, 0, (outward * L.hips) / 2];
      at[`knee_${side}`] = add(at[`hip_${side}`], [sin(thigh), -cos(thigh), 0], L.thigh);
      at[`ankle_${side}`] = add(at[`knee_${side}`], [sin(shank), -cos(shank), 0], L.shank);
      at[`toe_${side}`] = add(at[`ankle_${side}`], [0.1, -0.02, 0]);
    }
    return at;
  }

  // Draws one posture; `marks` are [part, text, share from 0 to 1].
  function draw(canvas, model, angles, sitting, marks, degrees) {
    const { width, height, pen, ink, soft, ground } = surface(canvas);
    // One scale for all postures and views: arms stretched up, or forward from a bent trunk, fit.
    const scale = Math.min(height / 1.3, width / 1.5);
    const place = joints(model, angles, sitting), view = turn(1, -degrees), seen = {};
    for (const name in place) seen[name] = apply(view, place[name]);
    const lowest = Math.min(...Object.values(seen).map((p) => p[1]));
    const at = (name) => [width / 2 + seen[name][0] * scale, height - 14 + (lowest - seen[name][1]) * scale];
    const line = (a, b, style, thick, dash = []) => {
      pen.beginPath();
      pen.strokeStyle = style;
      pen.lineWidth = thick;
      pen.lineCap = "round";
      pen.setLineDash(dash);
      pen.moveTo(...a);
      pen.lineTo(...b);
      pen.stroke();
      pen.setLineDash([]);
    };
    line([10, height - 9], [width - 10, height - 9], ground, 2);
    if (sitting) line(add2(at("hip"), -24, 8), add2(at("hip"), 30, 8), "#8d6e4f", 6);
    const far = (a, b) => seen[a][2] + seen[b][2];
    for (const [a, b, known] of [...model.limbs].sort((one, two) => far(one[0], one[1]) - far(two[0], two[1]))) {
      const missing = Number.isNaN(angles[known]);
      const style = missing ? soft : far(a, b) < -0.1 ? soft : ink;
      line(at(a), at(b), style, missing ? 4 : 7, missing ? [6, 8] : []);
      if (b.startsWith("ankle")) line(at(b), at(b.replace("ankle", "toe")), style, missing ? 4 : 7, missing ? [6, 8] : []);
    }
    for (const joint of ["shoulder", "hip"]) line(at(`${joint}_left`), at(`${joint}_right`), ink, 7);
    const [x, y] = at("head"), nose = at("nose");
    pen.beginPath();
    pen.arc(x, y, (model.lengths.head / 2) * scale, 0, 2 * Math.PI);
    pen.fillStyle = color("--card");
    pen.fill();
    pen.strokeStyle = ink;
    pen.lineWidth = 4;
    pen.stroke();
    line([x + (nose[0] - x) * 0.75, y + (nose[1] - y) * 0.75], [x + (nose[0] - x) * 1.15, y + (nose[1] - y) * 1.15], ink, 4);
    for (const [part, text, share] of marks) {
      for (const joint of model.spots[part] || []) {
        const [cx, cy] = at(joint);
        pen.beginPath();
        pen.arc(cx, cy, 8.5, 0, 2 * Math.PI);
        pen.fillStyle = share > 0.5 ? "#b92d2b" : "#f2b544";
        pen.fill();
        pen.fillStyle = share > 0.5 ? "#fff" : "#1b2430";
        pen.font = "700 11px system-ui, sans-serif";
        pen.textAlign = "center";
        pen.fillText(text, cx, cy + 4);
      }
    }
  }
  const add2 = (p, x, y) => [p[0] + x, p[1] + y];
  const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  // Prepares a canvas for its size on the screen and returns what to draw with.
  function surface(canvas) {
    const width = canvas.clientWidth, height = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    return { width, height, pen, ink: color("--ink"), soft: color("--faint"), ground: color("--line") };
  }
  return { joints, draw, surface, color };
})();
