// The page: one viewer a scene, what they share, keys.
"use strict";

(function () {
  const data = JSON.parse(document.getElementById("images").textContent);
  const tables = Object.fromEntries(Object.entries(data.maps).map(([name, map]) => [name, colourTable(map)]));
  const live = document.getElementById("live");
  const SHARED = ["layer", "mode", "stops", "view", "shown"];
  const KEEP = 3;  // scenes whose images stay decoded
  let active = null, keys = true;
  const recent = [];

  function say(words) { live.textContent = words; }

  // --- viewers ---

  const viewers = data.scenes.map((index, number) => new Viewer(
    document.getElementById(`viewer-${number}`), new SceneImages(index, document.getElementById(`pixels-${number}`)),
    tables, changed));

  function changed(viewer, what) {
    active = viewer;
    if ("spoken" in what) return say(what.spoken);
    const shared = Object.fromEntries(Object.entries(what).filter(([name]) => SHARED.includes(name)));
    for (const other of viewers) {
      if (other === viewer) continue;
      const same = "method" in what ? other.labels.indexOf(viewer.labels[viewer.state.method]) : -1;
      const changes = same >= 0 ? {...shared, method: same} : shared;
      if (Object.keys(changes).length) other.set(changes, false);
    }
    if ("layer" in what || "mode" in what) viewers.forEach((other) => other.redrawStrip());
    clearTimeout(changed.timer);
    changed.timer = setTimeout(drawRest, 1500);
  }

  // Decoded images take some 100 MB a scene: keep those of the scenes looked at last.
  function look(viewer) {
    recent.splice(0, recent.length, viewer, ...recent.filter((other) => other !== viewer));
    recent.splice(KEEP).forEach((old) => { if (!old.visible) old.images.drop(); else recent.push(old); });
  }

  let queue = Promise.resolve();
  const near = new IntersectionObserver((entries) => {
    for (const {target, isIntersecting} of entries) {
      const viewer = viewers.find((candidate) => candidate.element === target);
      viewer.visible = isIntersecting;
      if (!isIntersecting) continue;
      look(viewer);
      viewer.draw();
      if (!viewer.images.complete) queue = queue.then(() => viewer.visible && viewer.loadAll()).catch(failed);
    }
  }, {rootMargin: "400px 0px"});

  function failed(error) { say(`An image could not be decoded: ${error.message}`); console.error(error); }

  // Every scene is drawn, also those out of sight, so that all of them are there on paper, and in one exposure.
  async function drawAll() {
    for (const viewer of viewers) {
      if (!viewer.stale) continue;
      await viewer.load();
      await viewer.loadAll();
      if (!viewer.visible) viewer.images.drop();
      await new Promise((resolve) => (window.requestIdleCallback ?? setTimeout)(resolve));
    }
    document.documentElement.dataset.drawn = "";
  }

  function drawRest() { queue = queue.then(drawAll).catch(failed); }

  // --- keys ---

  function current() { return active ?? viewers.find((viewer) => viewer.visible); }

  function choose(viewer, number) {
    if (number < 0 || number >= viewer.labels.length) return;
    viewer.set({method: number});
    say(viewer.labels[number]);
  }

  const ACTIONS = {
    ArrowLeft: (v) => choose(v, (v.state.method + v.labels.length - 1) % v.labels.length),
    ArrowRight: (v) => choose(v, (v.state.method + 1) % v.labels.length),
    f: (v) => {
      v.set({view: "flip", shown: v.state.view === "flip" && v.state.shown === "method" ? "reference" : "method"});
      say(v.state.shown === "reference" ? "reference" : v.labels[v.state.method]);
    },
  };

  // Keys that the focused control needs for itself.
  function taken(target, key) {
    return target.closest("select, textarea") || (target.closest("input") && key.length > 1);
  }

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented || taken(event.target, event.key)) return;
    const viewer = current();
    if (!keys || !viewer) return;
    if (/^[1-9]$/.test(event.key)) return choose(viewer, Number(event.key) - 1);
    const action = ACTIONS[event.key];
    if (!action) return;
    event.preventDefault();
    action(viewer);
  });

  document.getElementById("keys-on")?.addEventListener("change", ({target}) => { keys = target.checked; });

  for (const viewer of viewers) {
    viewer.showControls();
    viewer.element.addEventListener("pointerenter", () => { active = viewer; });
    viewer.element.addEventListener("focusin", () => { active = viewer; });
    near.observe(viewer.element);
  }
  addEventListener("load", () => (window.requestIdleCallback ?? setTimeout)(drawRest));
})();
