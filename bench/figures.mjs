// The figures of pages, made anew: node bench/figures.mjs WORD PAGE... Between a line `<!-- figures: COMMAND -->` and the next line
// `<!-- end of figures -->` stands what COMMAND prints, with the command, what it was measured on and the commit above it: of
// all commands that contain WORD, which may be empty. A command that fails leaves its figures as they were, and the exit code is 1.
import { spawnSync } from "node:child_process";
import { cpus } from "node:os";
import { readFileSync, writeFileSync } from "node:fs";

const [word, ...pages] = process.argv.slice(2);
if (pages.length === 0) {
  console.error("usage: node bench/figures.mjs WORD PAGE...");
  process.exit(2);
}
const said = (command, ...words) => spawnSync(command, words, { encoding: "utf8" }).stdout ?? "";
const version = said("build/cardan", "version");
const found = (pattern) => version.match(pattern)?.[1] ?? "?";
const made = `${cpus()[0]?.model.trim() ?? "?"}, sweeps of ${found(/sweeps: (.*)/)}, ${found(/^cardan.*\n(.*)/)}, commit ${said("git", "rev-parse", "--short", "HEAD").trim()}`;

const begin = /^<!-- figures: (.*) -->$/, end = "<!-- end of figures -->";
let failed = 0, seen = 0;
for (const page of pages) {
  const out = [];
  const lines = readFileSync(page, "utf8").split("\n");
  for (let i = 0; i < lines.length; ++i) {
    out.push(lines[i]);
    const command = lines[i].match(begin)?.[1];
    if (!command) continue;
    const close = lines.indexOf(end, i);
    if (close < 0) throw new Error(`${page}:${i + 1}: no ${end} after it`);
    const before = lines.slice(i + 1, close);
    i = close - 1;
    if (!command.includes(word)) {
      out.push(...before);
      continue;
    }
    ++seen;
    console.error(command);
    const run = spawnSync("sh", ["-c", command], { encoding: "utf8", stdio: ["ignore", "pipe", "inherit"], maxBuffer: 1 << 26 });
    if (run.status !== 0) {
      console.error(`ended with ${run.status ?? run.signal}: its figures stay as they were`);
      ++failed;
      out.push(...before);
      continue;
    }
    out.push("", `\`${command}\` (${made}):`, "", run.stdout.trim(), "");
    writeFileSync(page, [...out, ...lines.slice(i + 1)].join("\n"));   // some take minutes: what is made is kept
  }
}
if (seen === 0) {
  console.error(`no figures whose command contains "${word}" in ${pages.join(", ")}`);
  process.exit(2);
}
process.exit(failed ? 1 : 0);
