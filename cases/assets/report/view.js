// Draws the scene of a report: electrodes coloured by charge, tracks of grains up to a time, axes with units.
//
// Places are in halves of the size of the picture from its middle; `metres` brings them back. Nothing is drawn unless something
// changed.
"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const scene = JSON.parse($("scene").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const floats = (text) => new Float32Array(bytes(text));
  const whole = (text) => new Uint32Array(bytes(text));

  // ---- Colours. Viridis (van der Walt and Smith, CC0) for one sign; for both signs blue to red over grey (Moreland 2009).
  const ONE_SIGN = ["#440154", "#482878", "#3e4a89", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
  const BOTH = ["#3b4cc0", "#5977e3", "#7b9ff9", "#9ebeff", "#c0d4f5", "#dddcdc", "#f2cbb7", "#f7ac8e", "#ee8468", "#d65244", "#b40426"];
  const PARTS = ["#7f8fa6", "#c49a6c", "#7aa57a", "#a685b0", "#b0a055", "#6ba3a8", "#b5767a", "#8f8f8f"];
  const TRACKS = ["#e69f00", "#0072b2", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#8a6d00", "#5b4fa8", "#b03060", "#3d8b37"];
  const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);
  const ramp = (stops) => {
    const colours = stops.map(rgb);
    return (t) => {
      const x = Math.min(1, Math.max(0, t)) * (colours.length - 1), k = Math.min(Math.floor(x), colours.length - 2);
      return [0, 1, 2].map((c) => colours[k][c] + (x - k) * (colours[k + 1][c] - colours[k][c]));
    };
  };

  // ---- Numbers for people.
  const PREFIX = [["f", -15], ["p", -12], ["n", -9], ["µ", -6], ["m", -3], ["", 0], ["k", 3], ["M", 6]];
  const prefixed = (largest, unit, highest = 6) => {
    const power = largest > 0 ? Math.floor(Math.log10(largest * (1 + 1e-9)) / 3) * 3 : 0;
    const [name, exponent] = PREFIX.find(([, e]) => e === Math.min(highest, Math.max(-15, power)));
    return { name: name + unit, factor: 10 ** -exponent };
  };
  const tidy = (x, digits = 4) => String(parseFloat(x.toPrecision(digits))).replace("-", "−");
  const people = (x, unit) => { const p = prefixed(Math.abs(x), unit); return `${tidy(x * p.factor)} ${p.name}`; };
  const nice = (span, most) => {
    const raw = span / most, power = 10 ** Math.floor(Math.log10(raw));
    return power * ([1, 2, 5, 10].find((m) => m * power >= raw * (1 - 1e-9)) || 10);
  };

  // ---- The canvas.
  const canvas = $("canvas"), stage = $("stage"), labels = $("labels");
  let renderer;
  try {
    THREE.ColorManagement.enabled = false;
    renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
  } catch (reason) {
    $("absent").hidden = false;
    canvas.hidden = true;
    $("controls").hidden = true;
    return;
  }
  renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  renderer.localClippingEnabled = true;
  const world = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(30, 1, 0.01, 100);
  camera.up.set(0, 0, 1);
  const orbit = new THREE.OrbitControls(camera, canvas);
  orbit.enableDamping = false;
  // Together they give a face that looks at the viewer the colour of the bar.
  world.add(new THREE.AmbientLight(0xffffff, 0.55 * Math.PI));
  const lamp = new THREE.DirectionalLight(0xffffff, 0.5 * Math.PI);
  camera.add(lamp);
  lamp.position.set(-0.6, 0.9, 1);
  world.add(camera);

  let asked = false;
  const draw = () => { if (!asked) { asked = true; requestAnimationFrame(() => { asked = false; render(); }); } };

  // ---- Electrodes: each triangle has corners of its own, whose colours and normals are means over the faces around them that bend
  // little from it, so that round electrodes look round and edges stay sharp.
  const plane = new THREE.Plane(new THREE.Vector3(-1, 0, 0), 0);
  const vertices = floats(scene.vertices), triangles = whole(scene.triangles);
  const around = () => {
    const count = triangles.length / 3, faces = new Float32Array(3 * count), sizes = new Float32Array(count), known = new Map();
    const spots = new Int32Array(vertices.length / 3), lists = [];
    for (let v = 0; v < spots.length; v++) {
      const key = [0, 1, 2].map((k) => Math.round(vertices[3 * v + k] * 1e6)).join();
      let n = known.get(key);
      if (n === undefined) { n = lists.length; lists.push([]); known.set(key, n); }
      spots[v] = n;
    }
    const [a, b, c] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    for (let t = 0; t < count; t++) {
      [a, b, c].forEach((p, k) => p.fromArray(vertices, 3 * triangles[3 * t + k]));
      b.sub(a).cross(c.sub(a)).toArray(faces, 3 * t);
      sizes[t] = b.length() || 1e-30;
      for (let k = 0; k < 3; k++) lists[spots[triangles[3 * t + k]]].push(t);
    }
    const near = (t, corner, what) => {
      for (const u of lists[spots[triangles[3 * t + corner]]]) {
        const dot = faces[3 * t] * faces[3 * u] + faces[3 * t + 1] * faces[3 * u + 1] + faces[3 * t + 2] * faces[3 * u + 2];
        if (dot > 0.7 * sizes[t] * sizes[u]) what(u);
      }
    };
    return { faces, sizes, near };
  };
  const parts = [];
  let mesh = null;
  if (triangles.length) {
    const { faces, near } = (mesh = around());
    const normals = new Float32Array(3 * triangles.length);
    for (let corner = 0; corner < triangles.length; corner++) {
      const sum = [0, 0, 0];
      near(Math.floor(corner / 3), corner % 3, (u) => { for (let k = 0; k < 3; k++) sum[k] += faces[3 * u + k]; });
      const length = Math.hypot(...sum) || 1;
      normals.set(sum.map((x) => x / length), 3 * corner);
    }
    for (const electrode of scene.electrodes) {
      const geometry = new THREE.BufferGeometry(), n = 3 * electrode.count;
      const position = new Float32Array(3 * n);
      for (let k = 0; k < n; k++) {
        const v = triangles[3 * electrode.first + k];
        position.set(vertices.subarray(3 * v, 3 * v + 3), 3 * k);
      }
      geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
      geometry.setAttribute("normal", new THREE.BufferAttribute(normals.subarray(9 * electrode.first, 9 * electrode.first + 3 * n), 3));
      geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * n), 3));
      const material = new THREE.MeshPhongMaterial({ vertexColors: true, side: THREE.DoubleSide, shininess: 10, specular: 0x0a0a0a, transparent: true });
      const part = new THREE.Mesh(geometry, material);
      world.add(part);
      parts.push(part);
    }
  }
  // A few panels at edges carry ten times the density of all others: the bar ends where all but one in fifty are.
  const colour = (number) => {
    const density = scene.densities[number], bar = $("colours");
    bar.replaceChildren();
    if (!density) {
      parts.forEach((part, e) => {
        const [r, g, b] = rgb(PARTS[e % PARTS.length]), colours = part.geometry.attributes.color;
        for (let k = 0; k < colours.count; k++) colours.setXYZ(k, r, g, b);
        colours.needsUpdate = true;
      });
      return;
    }
    const values = floats(density.values), sorted = Float32Array.from(values).sort();
    const at = (part) => sorted[Math.min(sorted.length - 1, Math.round(part * (sorted.length - 1)))];
    let [low, high] = [at(0.01), at(0.99)];
    const both = sorted[0] < 0 && sorted[sorted.length - 1] > 0 && Math.min(-low, high) > 0.01 * Math.max(-low, high);
    if (both) { high = Math.max(-low, high); low = -high; } else if (high > 0 && low > 0 && low < 0.5 * high) { low = 0; } else if (low < 0 && high < 0 && high > 0.5 * low) { high = 0; }
    const map = ramp(both ? BOTH : ONE_SIGN), span = high - low || 1;
    const of = (x) => map((x - low) / span);
    parts.forEach((part, e) => {
      const { first, count } = scene.electrodes[e], colours = part.geometry.attributes.color;
      for (let t = first; t < first + count; t++) {
        for (let k = 0; k < 3; k++) {
          let [charge, area] = [0, 0];
          mesh.near(t, k, (u) => { charge += values[u] * mesh.sizes[u]; area += mesh.sizes[u]; });
          colours.setXYZ(3 * (t - first) + k, ...of(area > 0 ? charge / area : values[t]));
        }
      }
      colours.needsUpdate = true;
    });
    const unit = prefixed(Math.max(Math.abs(low), Math.abs(high)), density.unit);
    const title = document.createElement("div"), strip = document.createElement("div");
    title.className = "title";
    title.textContent = `surface charge density ${density.name}, ${unit.name}`;
    strip.className = "bar";
    const stops = Array.from({ length: 21 }, (_, k) => `rgb(${map(k / 20).map((c) => Math.round(255 * c)).join(" ")})`);
    strip.style.background = `linear-gradient(to top, ${stops.join(", ")})`;
    const step = nice(span * unit.factor, 5);
    const put = (value, text) => {
      const label = document.createElement("span");
      label.style.bottom = `${(100 * (value / unit.factor - low)) / span}%`;
      label.textContent = text;
      strip.append(label);
    };
    const lowest = low * unit.factor, highest = high * unit.factor;
    for (let value = Math.ceil(lowest / step - 1e-9) * step; value <= highest + 1e-9 * step; value += step) put(value, tidy(Math.abs(value) < 1e-9 * step ? 0 : value, 6));
    bar.append(title, strip);
    const beyond = [];
    // Of a few percent nobody needs to know.
    if (sorted[sorted.length - 1] > high + 0.05 * span) beyond.push(`up to ${tidy(sorted[sorted.length - 1] * unit.factor, 3)}`);
    if (sorted[0] < low - 0.05 * span) beyond.push(`down to ${tidy(sorted[0] * unit.factor, 3)}`);
    if (beyond.length) {
      const note = document.createElement("div");
      note.className = "title";
      note.textContent = `at edges ${beyond.join(", ")}`;
      bar.append(note);
    }
  };

  // ---- Grains: tracks up to a time, points at that time.
  const flown = scene.tracks;
  const state = { part: 1, playing: false };
  const grains = { count: 0, places: new Float32Array(0) };
  let setTime = () => {};
  const uniforms = { now: { value: 1 }, tail: { value: 1 }, size: { value: 9 }, ratio: { value: 1 } };
  if (flown) {
    const lengths = whole(flown.lengths), outcomes = whole(flown.outcomes), numbers = whole(flown.grains);
    const points = floats(flown.points), times = floats(flown.times), n = lengths.length;
    const firsts = new Uint32Array(n);
    for (let g = 1; g < n; g++) firsts[g] = firsts[g - 1] + lengths[g - 1];
    const tint = (g) => rgb(TRACKS[numbers[g] % TRACKS.length]);
    const colours = new Float32Array(points.length), pairs = [];
    for (let g = 0; g < n; g++) {
      const of = tint(g);
      for (let k = 0; k < lengths[g]; k++) {
        colours.set(of, 3 * (firsts[g] + k));
        if (k > 0) pairs.push(firsts[g] + k - 1, firsts[g] + k);
      }
    }
    const track = new THREE.BufferGeometry();
    track.setAttribute("position", new THREE.BufferAttribute(points, 3));
    track.setAttribute("tint", new THREE.BufferAttribute(colours, 3));
    track.setAttribute("when", new THREE.BufferAttribute(times, 1));
    track.setIndex(new THREE.BufferAttribute(new Uint32Array(pairs), 1));
    const faint = Math.max(0.12, Math.min(0.9, 12 / n));
    const trails = new THREE.LineSegments(track, new THREE.ShaderMaterial({
      uniforms: { ...uniforms, faint: { value: faint } },
      transparent: true,
      depthWrite: false,
      vertexShader: "attribute vec3 tint; attribute float when; varying vec3 shown; varying float at; void main() { shown = tint; at = when; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
      fragmentShader: "uniform float now, tail, faint; varying vec3 shown; varying float at; void main() { if (at > now + 1e-6 || at < now - tail) discard; float fresh = 1.0 - (now - at) / tail; gl_FragColor = vec4(shown, faint * mix(0.4, 1.0, fresh)); }",
    }));
    trails.frustumCulled = false;
    trails.renderOrder = 2;
    world.add(trails);

    grains.count = n;
    grains.places = new Float32Array(3 * n);
    const tints = new Float32Array(3 * n), ended = new Float32Array(n);
    for (let g = 0; g < n; g++) tints.set(tint(g), 3 * g);
    const cloud = new THREE.BufferGeometry();
    cloud.setAttribute("position", new THREE.BufferAttribute(grains.places, 3));
    cloud.setAttribute("tint", new THREE.BufferAttribute(tints, 3));
    cloud.setAttribute("ended", new THREE.BufferAttribute(ended, 1));
    const dots = new THREE.Points(cloud, new THREE.ShaderMaterial({
      uniforms,
      transparent: true,
      depthWrite: true,
      vertexShader: "attribute vec3 tint; attribute float ended; varying vec3 shown; varying float how; uniform float size, ratio; void main() { shown = tint; how = ended; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); gl_PointSize = size * ratio * (how > 0.5 ? 1.5 : 1.0); }",
      // A shaded ball while it flies, a cross where it struck, a ring where it left.
      fragmentShader: `varying vec3 shown; varying float how; void main() {
        vec2 p = 2.0 * gl_PointCoord - 1.0; float r = length(p);
        if (how < 0.5) { if (r > 1.0) discard; float light = 0.55 + 0.45 * sqrt(1.0 - r * r) - 0.25 * (p.x + p.y) * (1.0 - r); gl_FragColor = vec4(shown * min(light, 1.15), 1.0); if (r > 0.86) gl_FragColor.rgb *= 0.45; return; }
        if (how < 1.5) { if (min(abs(p.x - p.y), abs(p.x + p.y)) > 0.32) discard; gl_FragColor = vec4(shown * 0.75, 1.0); return; }
        if (r > 1.0 || r < 0.62) discard; gl_FragColor = vec4(shown * 0.75, 1.0); }`,
    }));
    dots.frustumCulled = false;
    dots.renderOrder = 3;
    world.add(dots);

    const unit = prefixed(Math.max(Math.abs(flown.start), Math.abs(flown.end)), "s", 0);
    const said = (part) => (flown.start + part * (flown.end - flown.start)) * unit.factor;
    const decimals = Math.max(0, 3 - Math.floor(Math.log10(Math.max(1e-30, (flown.end - flown.start) * unit.factor))) - 1);
    setTime = (part) => {
      state.part = part;
      uniforms.now.value = part;
      for (let g = 0; g < n; g++) {
        const first = firsts[g], last = first + lengths[g] - 1;
        let [a, b] = [first, last];
        while (b - a > 1) { const middle = (a + b) >> 1; if (times[middle] <= part) a = middle; else b = middle; }
        const over = times[b] - times[a], x = over > 0 ? Math.min(1, Math.max(0, (part - times[a]) / over)) : 0;
        for (let k = 0; k < 3; k++) grains.places[3 * g + k] = points[3 * a + k] + x * (points[3 * b + k] - points[3 * a + k]);
        ended[g] = part >= times[last] - 1e-6 && outcomes[g] > 0 ? (outcomes[g] === 1 ? 1 : 2) : 0;
      }
      cloud.attributes.position.needsUpdate = true;
      cloud.attributes.ended.needsUpdate = true;
      const text = `t = ${said(part).toFixed(Math.min(decimals, 12)).replace("-", "−")} ${unit.name}`;
      $("now").textContent = text;
      $("time").setAttribute("aria-valuetext", text);
      $("time").value = Math.round(1000 * part);
      const flying = n - ended.reduce((sum, how) => sum + (how > 0), 0), struck = ended.reduce((sum, how) => sum + (how === 1), 0);
      const list = [["●", "flying", flying], ["✕", "struck", struck], ["○", "left or given up", n - flying - struck]];
      $("ends").replaceChildren(...list.filter(([, , count], k) => count > 0 || k === 0).map(([sign, name, count]) => {
        const item = document.createElement("li"), key = document.createElement("span");
        key.className = "key";
        key.textContent = sign;
        item.append(key, ` ${name}: ${count}`);
        return item;
      }));
      draw();
    };
    $("player").hidden = false;
    $("grains").hidden = false;
    document.querySelector('[data-side="grains"]').hidden = false;
    $("time").addEventListener("input", () => { stop(); setTime($("time").value / 1000); });
    const stop = () => { state.playing = false; $("play").textContent = "▶"; $("play").setAttribute("aria-label", "Play"); };
    $("play").addEventListener("click", () => {
      if (state.playing) { stop(); return; }
      state.playing = true;
      $("play").textContent = "❚❚";
      $("play").setAttribute("aria-label", "Pause");
      let part = state.part >= 1 ? 0 : state.part, before = performance.now();
      const step = (time) => {
        if (!state.playing) return;
        part = Math.min(1, part + (time - before) / 1000 / Number($("speed").value));
        before = time;
        setTime(part);
        if (part < 1) requestAnimationFrame(step); else stop();
      };
      requestAnimationFrame(step);
    });
    $("size").addEventListener("input", () => { uniforms.size.value = Number($("size").value); draw(); });
    $("trail").addEventListener("change", () => { uniforms.tail.value = Math.max(1e-9, Number($("trail").value)); trails.visible = $("trail").value !== "0"; draw(); });
  }

  // ---- Null points and minima of an analysis.
  const tags = [];
  for (const { kind, of, position } of scene.marks) {
    const at = new THREE.Vector3(...position);
    let tag = tags.find((other) => other.at.distanceTo(at) < 1e-3);
    if (!tag) { tag = { at, of: { null: [], minimum: [] } }; tags.push(tag); }
    if (!tag.of[kind].includes(of)) tag.of[kind].push(of);
  }
  for (const tag of tags) {
    const words = Object.entries(tag.of).filter(([, of]) => of.length).map(([kind, of]) => `${kind} ${kind === "null" ? "of" : "for"} ${of.join(", ")}`);
    tag.text = words.join("; ");
  }

  // ---- The box with its axes.
  const metres = (k, x) => scene.center[k] + scene.size * x;
  const box = { low: new THREE.Vector3(...scene.low), high: new THREE.Vector3(...scene.high) };
  const diagonal = box.high.distanceTo(box.low);
  const margin = 0.035 * diagonal;
  const frame = { low: box.low.clone().subScalar(margin), high: box.high.clone().addScalar(margin) };
  const ink = new THREE.LineBasicMaterial({ transparent: true, opacity: 0.55 });
  const lines = new THREE.LineSegments(new THREE.BufferGeometry(), ink);
  lines.frustumCulled = false;
  world.add(lines);
  const length = prefixed(Math.max(...[0, 1, 2].map((k) => Math.max(Math.abs(metres(k, scene.low[k])), Math.abs(metres(k, scene.high[k]))))), "m", 0);
  // Ticks at round numbers along each axis, as far apart for all three as there is room on the longest.
  const step = nice(2 * scene.size * length.factor, 5);
  const ticks = [0, 1, 2].map((k) => {
    const [low, high] = [metres(k, frame.low.getComponent(k)) * length.factor, metres(k, frame.high.getComponent(k)) * length.factor];
    const list = [];
    for (let x = Math.ceil(low / step - 1e-9) * step; x <= high + 1e-9 * step; x += step) {
      list.push({ text: tidy(Math.abs(x) < 1e-9 * step ? 0 : x, 6), at: (x / length.factor - scene.center[k]) / scene.size });
    }
    return list;
  });
  const spans = [];
  const span = (number, className, text) => {
    if (!spans[number]) { spans[number] = document.createElement("span"); labels.append(spans[number]); }
    const of = spans[number];
    if (of.className !== className) of.className = className;
    if (of.textContent !== text) of.textContent = text;
    of.hidden = false;
    return of;
  };
  const centre = new THREE.Vector3(), outward = new THREE.Vector3();
  // Of the four edges of the box along an axis the one that is farthest out on the screen, at its left or its bottom.
  const axes = () => {
    const corner = (sides) => new THREE.Vector3(...[0, 1, 2].map((k) => (sides[k] ? frame.high : frame.low).getComponent(k)));
    const onScreen = (p) => p.clone().project(camera);
    const eye = camera.position, points = [], shown = [];
    centre.addVectors(frame.low, frame.high).multiplyScalar(0.5);
    const middle = onScreen(centre);
    const towards = eye.clone().sub(orbit.target).normalize();
    for (let k = 0; k < 3; k++) {
      // An axis that points at the viewer has nothing to tell.
      if (Math.abs(towards.getComponent(k)) > 0.985) continue;
      const [u, v] = [(k + 1) % 3, (k + 2) % 3];
      let best = null;
      for (const [a, b] of [[0, 0], [0, 1], [1, 0], [1, 1]]) {
        const from = [0, 0, 0], to = [0, 0, 0];
        [from[u], from[v], to[u], to[v]] = [a, b, a, b];
        to[k] = 1;
        const [p, q] = [corner(from), corner(to)], s = onScreen(p.clone().add(q).multiplyScalar(0.5));
        // Exactly one of the two faces at the edge is seen: the edge is on the outline.
        const faces = [[u, a], [v, b]].filter(([axis, side]) => {
          const place = (side ? frame.high : frame.low).getComponent(axis);
          return side ? eye.getComponent(axis) > place : eye.getComponent(axis) < place;
        }).length;
        const score = (k === 2 ? -s.x : -s.y) + (faces === 1 ? 10 : 0);
        if (!best || score > best.score) best = { score, p, q, s };
      }
      points.push(best.p, best.q);
      outward.subVectors(best.s, middle).setZ(0).normalize();
      for (const tick of ticks[k]) {
        const at = best.p.clone().setComponent(k, tick.at);
        const away = at.clone().sub(centre).setComponent(k, 0).normalize().multiplyScalar(0.018 * diagonal);
        points.push(at, at.clone().add(away));
        shown.push({ text: tick.text, className: "", at: at.clone().addScaledVector(away, 2.2) });
      }
      const end = best.p.clone().add(best.q).multiplyScalar(0.5), away = end.clone().sub(centre).setComponent(k, 0).normalize();
      shown.push({ text: `${"xyz"[k]} (${length.name})`, className: "axis", at: end.addScaledVector(away, 0.115 * diagonal) });
    }
    lines.geometry.setFromPoints(points);
    return shown;
  };
  const place = (number, { text, className, at }) => {
    const p = at.clone().project(camera), of = span(number, className, text);
    if (p.z > 1 || Math.abs(p.x) > 1.05 || Math.abs(p.y) > 1.05) { of.hidden = true; return; }
    // In parts of the view, which is of another size on paper.
    of.style.left = `${(50 + 50 * p.x).toFixed(2)}%`;
    of.style.top = `${(50 - 50 * p.y).toFixed(2)}%`;
    of.style.transform = `translate(${className === "mark" ? "6px, -50%" : "-50%, -50%"})`;
  };

  // ---- Nulls as little crosses.
  if (tags.length) {
    const size = 0.012 * diagonal, points = [];
    for (const { at } of tags) for (const k of [0, 1, 2]) for (const sign of [-1, 1]) points.push(at.clone().setComponent(k, at.getComponent(k) + sign * size));
    const crosses = new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(points), new THREE.LineBasicMaterial({ color: 0xd0021b, depthTest: false, transparent: true }));
    crosses.renderOrder = 4;
    world.add(crosses);
  }

  const render = () => {
    const shown = axes();
    for (const tag of tags) shown.push({ text: tag.text, className: "mark", at: tag.at });
    shown.forEach((label, number) => place(number, label));
    for (let k = shown.length; k < spans.length; k++) spans[k].hidden = true;
    renderer.render(world, camera);
  };

  // ---- Where one looks from.
  const target = new THREE.Vector3();
  const look = (direction, low, high) => {
    target.addVectors(low, high).multiplyScalar(0.5);
    const arm = direction.clone().normalize();
    orbit.target.copy(target);
    // As near as leaves all corners on the screen, with room for numbers and for the bar of colours.
    let distance = Math.max(1e-4, 0.5 * high.distanceTo(low));
    for (let tries = 0; tries < 60; tries++) {
      camera.position.copy(target).addScaledVector(arm, distance);
      camera.lookAt(target);
      camera.near = distance / 100;
      camera.far = distance + 20;
      camera.updateProjectionMatrix();
      camera.updateMatrixWorld();
      let most = 0;
      for (let corner = 0; corner < 8; corner++) {
        const at = new THREE.Vector3(...[0, 1, 2].map((k) => (corner >> k & 1 ? high : low).getComponent(k)));
        const behind = at.clone().sub(camera.position).dot(arm) > -1e-6, seen = at.project(camera);
        most = behind ? Infinity : Math.max(most, Math.abs(seen.x) / 0.82, Math.abs(seen.y) / 0.85);
      }
      if (most <= 1) break;
      distance *= 1.06;
    }
    orbit.update();
    draw();
  };
  const SIDES = { iso: [-0.62, -1, 0.55], x: [1, 0, 0.001], y: [0, -1, 0.001], z: [0, -0.001, 1] };
  const from = (side) => {
    if (side !== "grains") { look(new THREE.Vector3(...SIDES[side]), frame.low, frame.high); return; }
    const near = new THREE.Box3();
    for (let g = 0; g < grains.count; g++) near.expandByPoint(new THREE.Vector3().fromArray(grains.places, 3 * g));
    const least = new THREE.Vector3(1, 1, 1).multiplyScalar(0.02);
    const [low, high] = [near.min.clone().max(frame.low).sub(least), near.max.clone().min(frame.high).add(least)];
    look(camera.position.clone().sub(orbit.target), low, high);
  };
  $("sides").addEventListener("click", (event) => { if (event.target.dataset.side) from(event.target.dataset.side); });
  canvas.addEventListener("keydown", (event) => {
    const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    const zoom = { "+": 0.9, "=": 0.9, "-": 1 / 0.9 }[event.key];
    if (!turn && !zoom) return;
    event.preventDefault();
    const arm = camera.position.clone().sub(orbit.target);
    if (turn) {
      arm.applyAxisAngle(camera.up, turn[0]);
      const side = new THREE.Vector3().crossVectors(camera.up, arm).normalize(), tilted = arm.clone().applyAxisAngle(side, turn[1]);
      if (tilted.angleTo(camera.up) > 0.02 && tilted.angleTo(camera.up) < Math.PI - 0.02) arm.copy(tilted);
    } else arm.multiplyScalar(zoom);
    camera.position.copy(orbit.target).add(arm);
    orbit.update();
    draw();
  });
  orbit.addEventListener("change", draw);

  // ---- Controls of the electrodes.
  const list = $("electrodes").querySelector("ul");
  scene.electrodes.forEach((electrode, e) => {
    const item = document.createElement("li"), label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = true;
    box.addEventListener("change", () => { parts[e].visible = box.checked; draw(); });
    const value = document.createElement("span");
    value.className = "value";
    const told = [];
    if (electrode.voltage !== null) told.push(people(electrode.voltage, "V"));
    if (electrode.charge !== null) told.push(people(electrode.charge, "C"));
    value.textContent = told.join(", ");
    value.title = "at the start";
    label.append(box, electrode.name, value);
    item.append(label);
    list.append(item);
  });
  $("electrodes").hidden = scene.electrodes.length === 0;
  const dress = () => {
    const opacity = Number($("opacity").value), axis = $("cut").value, cut = axis !== "";
    $("depthlabel").hidden = !cut;
    if (cut) {
      const k = Number(axis), part = Number($("depth").value);
      plane.normal.set(0, 0, 0).setComponent(k, k === 1 ? 1 : -1);
      const [low, high] = [scene.low[k], scene.high[k]];
      // The half that hides the other from the oblique view goes away.
      plane.constant = (k === 1 ? -1 : 1) * (low + (high - low) * part);
    }
    for (const { material } of parts) {
      material.opacity = opacity;
      material.depthWrite = opacity > 0.98;
      material.clippingPlanes = cut ? [plane] : [];
      material.needsUpdate = true;
    }
    parts.forEach((part, e) => { part.visible = opacity > 0 && list.querySelectorAll("input")[e].checked; });
    draw();
  };
  $("opacity").addEventListener("input", dress);
  $("cut").addEventListener("change", dress);
  $("depth").addEventListener("input", dress);
  scene.densities.forEach((density, k) => $("density").append(new Option(density.name, k)));
  $("densitylabel").hidden = scene.densities.length < 2;
  $("density").addEventListener("change", () => { colour(Number($("density").value)); draw(); });

  // ---- Size, light and dark.
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const tone = () => { ink.color.set(dark.matches ? 0xb8c2cc : 0x59626d); draw(); };
  dark.addEventListener("change", tone);
  const fit = () => {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    renderer.setPixelRatio(ratio);
    renderer.setSize(stage.clientWidth, stage.clientHeight, false);
    uniforms.ratio.value = ratio;
    camera.aspect = stage.clientWidth / Math.max(1, stage.clientHeight);
    stage.style.setProperty("--aspect", camera.aspect.toFixed(4));
    camera.updateProjectionMatrix();
    draw();
  };
  new ResizeObserver(fit).observe(stage);
  // Where grains fly inside of what surrounds them, one must see through it.
  $("opacity").value = flown || tags.length ? 0.7 : 1;
  colour(0);
  dress();
  fit();
  tone();
  from("iso");
  setTime(1);
  window.addEventListener("beforeprint", render);
  // For those who look at the page with a program: time as a part of the flight, and where the grains are then, in metres.
  window.graintrap = {
    get part() { return state.part; },
    set part(x) { setTime(x); render(); },
    places: () => Array.from(grains.places, (x, k) => metres(k % 3, x)),
    render,
  };
})();
