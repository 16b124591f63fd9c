// What happened in a run: how it ended, its phases, events, warnings and printed lines. Nothing here knows of a document: a test runs
// this file by itself.

const seconds = (t) => `${Number(t.toPrecision(9))} s`;

/// How the run ended, in a sentence. `last`: time of the last row [s], or undefined.
export function ending({ run, summary, last }) {
  if (!summary) {
    const saved = last === undefined ? "No row was saved." : `The last row that was saved is at t = ${seconds(last)}.`;
    return (run.finished ? "The run wrote no summary. " : "Not finished: the run is still going on, or was killed. ") + saved;
  }
  const { simulated_s: t, planned_s: planned, verdict, ended_by: by, failure } = summary;
  const at = typeof t === "number" ? `at t = ${seconds(t)}` : "", of = typeof planned === "number" && planned > t ? ` of ${seconds(planned)}` : "";
  const failed = (summary.checks || []).filter((c) => c.verdict !== "pass").length;
  if (verdict === "interrupted") return `Interrupted ${at}${of}${by ? ` by ${by}` : ""}; checks were not worked out.`;
  if (verdict === "aborted") return `Ended ${at}${of} by an error${failure ? `, ${failure.code}: ${failure.title}` : by ? `, ${by}` : ""}; checks were not worked out.`;
  const how = by && by.startsWith("stop()") ? `Ended ${at}${of} by ${by}` : `Reached its planned end ${at}`;
  return failed ? `${how}; ${failed === 1 ? "a check" : `${failed} checks`} failed.` : `${how}.`;
}

/// The stretches of time that phases take: [{from, to, name}]; the last ends with the run.
export function bands(phases, end) {
  return phases.map(([from, name], i) => ({ from, to: i + 1 < phases.length ? phases[i + 1][0] : end, name }))
               .filter(({ from, to, name }) => name !== "" && from !== null && to >= from);
}

/// Instants to be marked: [{t, kind, text}], in order of time.
export function instants(notes) {
  const events = notes.events.map(([t, name, direction]) => ({ t, kind: "event", label: name, text: `event "${name}"${direction ? `, ${direction}` : ""}` }));
  const warnings = notes.warnings.map(([t, code, about]) => ({ t, kind: "warning", label: code, text: `${code}: ${about}` }));
  return [...events, ...warnings].filter(({ t }) => t !== null).sort((a, b) => a.t - b.t);
}

/// What the cursor tells at time t: the phase, and the instants within `reach` of it, of many the first.
export function told({ bands, instants }, t, reach) {
  const kMost = 6, near = instants.filter((mark) => Math.abs(mark.t - t) <= reach);
  return [...bands.filter(({ from, to }) => from <= t && t <= to).map(({ name }) => `phase "${name}"`),
          ...near.slice(0, kMost).map((mark) => `${seconds(mark.t)}  ${mark.text}`), ...(near.length > kMost ? [`and ${near.length - kMost} more`] : [])];
}

/// The axis along which a mode moves the points (x, y, z of each), where it is nearly one: "x", "y", "z", or "".
export function axisOf(shape) {
  const squares = [0, 1, 2].map((k) => shape.reduce((sum, u, i) => sum + (i % 3 === k ? u * u : 0), 0)), all = squares[0] + squares[1] + squares[2];
  return ["x", "y", "z"].find((none, k) => squares[k] > 0.98 * all) || "";
}

/// All of it as a list in order of time, what was before the run first: [{t, kind, text, more}].
export function story(notes) {
  const all = [
    ...notes.phases.map(([t, name]) => ({ t, kind: "phase", text: name === "" ? "the last phase is over" : name, more: "" })),
    ...notes.events.map(([t, name, direction]) => ({ t, kind: "event", text: name, more: direction })),
    ...notes.warnings.map(([t, code, about, path]) => ({ t, kind: "warning", text: `${code}: ${about}`, more: path })),
    ...notes.printed.map(([t, line, by]) => ({ t, kind: "printed", text: line, more: by })),
  ];
  return all.sort((a, b) => (a.t ?? -Infinity) - (b.t ?? -Infinity) || 0);  // stable: as they stand within an instant
}

/// The warnings of the summary, or where there is none those that were noted.
export function warningsOf(summary, notes) {
  if (summary) return summary.warnings || [];
  return notes.warnings.map(([t, code, about, path, place, hint]) => ({ t, code, about, path, place, hint }));
}

/// Channels and what is not drawn as groups with a part for each body: [{key, parts: [{name, channels, still}]}]. The group is the first folder
/// of the path, the part the second one where there are three; `known` groups come first, in their order.
export function groupsOf(channels, still, known) {
  const groups = new Map();
  const put = (kind, channel) => {
    const folders = channel.path.split("/"), key = folders.length > 1 ? folders[0] : "other", name = folders.length > 2 ? folders[1] : "";
    if (!groups.has(key)) groups.set(key, new Map());
    const parts = groups.get(key);
    if (!parts.has(name)) parts.set(name, { name, channels: [], still: [] });
    parts.get(name)[kind].push({ ...channel, name: folders.slice(name ? 2 : folders.length > 1 ? 1 : 0).join(" · ") });
  };
  channels.forEach((channel) => put("channels", channel));
  Object.values(still).flat().forEach((channel) => put("still", channel));
  const rank = (key) => (known.includes(key) ? known.indexOf(key) : known.length);
  return [...groups].map(([key, parts]) => ({ key, parts: [...parts.values()] })).sort((a, b) => rank(a.key) - rank(b.key));
}
