// A page and the server behind it: orders, what was refused, and events.

/** Send an order; says on the page what was refused. A page's own ENDED is said where nobody answers. */
async function order(what, wanted = {}) {
  try {
    const answer = await fetch("do", { method: "POST", headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ what, ...wanted }) });
    const told = await answer.json();
    say(told.error ?? "");
    return answer.ok ? told : null;
  } catch {
    say(ENDED);
    return null;
  }
}

function say(text) {
  put("message", text);
}

/** Put text where it changed, so that readers of screens are not told the same again. */
function put(id, text) {
  if (byId(id).textContent !== text) byId(id).textContent = text;
}

/** Hear the server's events, each by the function of its kind; then call `after`, and `lost` where the server is gone. */
function listen(heard, after, lost) {
  const events = new EventSource("events");
  events.onmessage = (message) => {
    const event = JSON.parse(message.data);
    heard[event.kind](event);
    after();
  };
  events.onerror = lost;
  return events;
}
