// Follows a running plan when the page comes from its server; silent where there is none.
"use strict";

const AGAIN = 2000; // [ms]
const banner = find(".banner");
const follow = { heard: false };
window.follow = follow;

const SAYS = {
  running: (yours) => (yours ? "Your turn" : "The robot is working"),
  waiting: (yours) => (yours ? "Waiting for you" : "Waiting"),
  failed: () => "Stopped",
  finished: () => "Finished",
};

function tell(kind, state, words) {
  banner.className = `banner ${kind}`;
  find(".state", banner).textContent = state;
  find(".words", banner).textContent = words;
  banner.hidden = !state;
  root.classList.toggle("told", Boolean(state));
  root.style.setProperty("--told", `${banner.offsetHeight}px`);
  if (stage) stage.fit(find("figure", player.slide));
}

function hear({ action, state, text, plan: made }) {
  // The run goes on with a plan that was made anew: its page has the same address.
  if (follow.made !== undefined && made !== undefined && made !== follow.made) location.reload();
  follow.made = made;
  follow.state = state;
  const known = Number.isInteger(action) && plan.actions[action];
  const yours = Boolean(known && known.you);
  if (state !== "done") {
    const says = SAYS[state];
    const kind = yours && (state === "waiting" || state === "running") ? "yours" : state;
    if (says) tell(kind, says(yours), text || "");
  }
  const place = state === "finished" ? plan.actions.length + 1 : known ? action + 1 : null;
  // The worker may look at other slides; only a new action calls the page back.
  if (place === null || follow.place === place) return;
  follow.place = place;
  Reveal.slide(place);
  if (known && state !== "failed") player.play();
}

function listen() {
  const source = new EventSource("events");
  source.onopen = () => {
    follow.heard = true;
    if (banner.classList.contains("lost")) tell("", "", "");
  };
  source.onmessage = (event) => {
    follow.heard = true;
    hear(JSON.parse(event.data));
  };
  source.onerror = () => {
    // A plain file server has no events: the page stays in the reader's hands. After the end there is nothing to hear.
    if (!follow.heard || follow.state === "finished") {
      source.close();
      return;
    }
    if (follow.state !== "failed") tell("lost", "Connection lost", "Trying again …");
    if (source.readyState !== EventSource.CLOSED) return;
    source.close();
    setTimeout(listen, AGAIN);
  };
}

if (location.protocol.startsWith("http")) {
  const start = () => (root.dataset.ready ? listen() : setTimeout(start, 50));
  start();
}
