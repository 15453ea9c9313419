// Follows a running plan if the page comes from its server; does nothing on other servers.
"use strict";

const RETRY = 2000; // [ms]
const banner = find(".banner");
const follow = { connected: false };
window.follow = follow;

const STATES = {
  running: (person) => (person ? `${person === "You" ? "Your" : `${person}'s`} turn` : "The robot is working"),
  waiting: (person) => (person ? `Waiting for ${person === "You" ? "you" : person}` : "Waiting"),
  failed: () => "Stopped",
  finished: () => "Finished",
};

function showBanner(kind, state, words) {
  banner.className = `banner ${kind}`;
  find(".state", banner).textContent = state;
  find(".words", banner).textContent = words;
  banner.hidden = !state;
  root.classList.toggle("has-banner", Boolean(state));
  makeRoom();
}

// The slide begins below the banner, whose words take more lines on a phone that is turned.
function makeRoom() {
  root.style.setProperty("--banner", `${banner.offsetHeight}px`);
  if (stage) stage.fit(find("figure", player.slide));
}

addEventListener("resize", makeRoom);

function onEvent({ action, state, text, plan: number, wait }) {
  // The run continues with a new plan, whose page has the same address.
  if (follow.plan !== undefined && number !== undefined && number !== follow.plan) location.reload();
  follow.plan = number;
  follow.state = state;
  // An instruction counts only while the world is as the plan says; until then the reason stands in its place.
  root.classList.toggle("wait", Boolean(wait));
  // Actions at the same time have one slide.
  const phase = Number.isInteger(action) ? plan.phases[action] : undefined;
  const known = plan.actions[phase];
  const yours = Boolean(known && known.you);
  if (wait && state === "waiting") {
    showBanner("waiting", "Please wait", (text || "").replace(/^Please wait\. /, ""));
  } else if (state !== "done") {
    const heading = STATES[state];
    const kind = yours && (state === "waiting" || state === "running") ? "yours" : state;
    if (heading) showBanner(kind, heading(yours ? known.who : ""), text || "");
  }
  const slide = state === "finished" ? plan.actions.length + 1 : known ? phase + 1 : null;
  // The worker may look at other slides; only a new action changes the slide.
  if (slide === null || follow.slide === slide) return;
  follow.slide = slide;
  Reveal.slide(slide);
  if (known && state !== "failed") player.play();
}

function listen() {
  const source = new EventSource("events");
  source.onopen = () => {
    follow.connected = true;
    if (banner.classList.contains("lost")) showBanner("", "", "");
  };
  source.onmessage = (event) => {
    follow.connected = true;
    onEvent(JSON.parse(event.data));
  };
  source.onerror = () => {
    // A plain file server has no events: the reader controls the page. After the end no events follow.
    if (!follow.connected || follow.state === "finished") {
      source.close();
      return;
    }
    if (follow.state !== "failed") showBanner("lost", "Connection lost", "Trying to reconnect …");
    if (source.readyState !== EventSource.CLOSED) return;
    source.close();
    setTimeout(listen, RETRY);
  };
}

if (location.protocol.startsWith("http")) {
  const start = () => (root.dataset.ready ? listen() : setTimeout(start, 50));
  start();
}
