// Mutation of the product: signs, indices and factors at seeded places of the physics are changed, one at a time, in a copy of the sources that is built
// with -O1 for one instruction set; what no test notices is listed. `./dev mutate [N] [SEED]` makes the copy and the build and then calls
//   node tests/mutation/mutate.mjs FOLDER N SEED       FOLDER/source, FOLDER/build; results are appended to FOLDER/SEED.jsonl: a run that was ended goes on
import fs from "node:fs";
import path from "node:path";
import { spawnSync } from "node:child_process";

const [folder, count = "200", seed = "1"] = process.argv.slice(2);
const kFolders = ["core/soa", "core/dynamics", "core/operators", "bodies", "hinges"];
const kLimit = 30;  // [s] of the tests of one mutant
// Fastest to find something first. The long ones of a program are left out: they repeat laws on more states.
const only = (process.env.CARDAN_MUTATE_TESTS || "").split(",").filter(Boolean);  // some of the programs alone, for a quicker look
const programsOf = (file) => (file.startsWith("bodies/modal/") ? ["test_modal"] : ["oracle_check", "test_contract", "test_operators", "test_properties"]);
const testsOf = (file) => programsOf(file).filter((program) => !only.length || only.includes(program));
const targetsOf = (file) => [...testsOf(file), ...(testsOf(file).includes("oracle_check") ? ["custom_cam"] : [])];

const source = path.join(folder, "source"), build = path.join(folder, "build");

const kRules = [
  ["sign", / \+ /g, () => " - "], ["sign", /(?<=[\w)\]]) - /g, () => " + "], ["sign", / \+= /g, () => " -= "], ["sign", / -= /g, () => " += "],
  ["index", /\[([0-2])\]/g, (m) => `[${(Number(m[1]) + 1) % 3}]`], ["index", /\.([xyz])\(\)/g, (m) => `.${{ x: "y", y: "z", z: "x" }[m[1]]}()`],
  ["factor", /\b0\.5 \* /g, () => "1.0 * "], ["factor", /\b2(\.0)? \* /g, () => "1.0 * "], ["factor", /\b3(\.0)? \* /g, () => "1.0 * "],
];

/// Code alone: comments, texts and what the preprocessor reads are blanked, character by character.
function codeOf(text) {
  const blank = (part) => part.replace(/[^\n]/g, " ");
  return text.replace(/\/\/[^\n]*|\/\*[\s\S]*?\*\/|R"(\w*)\([\s\S]*?\)\1"|"(\\.|[^"\\\n])*"|'(\\.|[^'\\\n])'|^\s*#[^\n]*/gm, blank);
}
/// Not physics: loops, sizes, texts, refusals, operation counts, includes of hinges' tables.
const isPlumbing = (line) => /\bfor \(|static_cast|size\(\)|fmt::|std::string|refuse|reserve|static_assert|throw |constexpr (int|std)|iterator|\.begin|\.end|offset|kernel_cost|cost/.test(line);

function placesIn(file) {
  const text = fs.readFileSync(path.join(source, file), "utf8"), code = codeOf(text), lines = code.split("\n"), places = [];
  const starts = [0];
  for (let i = 0; i < code.length; ++i) if (code[i] === "\n") starts.push(i + 1);
  for (const [kind, pattern, change] of kRules)
    for (const m of code.matchAll(pattern)) {
      let line = starts.findIndex((start) => start > m.index);
      line = line < 0 ? starts.length : line;
      if (!isPlumbing(lines[line - 1])) places.push({ file, kind, line, at: m.index, from: m[0], to: change(m) });
    }
  return places;
}

/// Numbers of a generator with 32 bits of state (mulberry32): the same mutants for the same seed.
function generator(state) {
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

function sources(dir) {
  return fs.readdirSync(path.join(source, dir), { withFileTypes: true }).flatMap((entry) => {
    const name = path.join(dir, entry.name);
    return entry.isDirectory() ? sources(name) : /\.(cpp|hpp)$/.test(name) && !/cost|help|kernels\.cpp|register/.test(name) ? [name] : [];
  }).sort();
}

function run(command, args, seconds) {
  const done = spawnSync("sh", ["-c", 'ulimit -v 8000000; exec "$0" "$@"', command, ...args], { timeout: 1000 * seconds, killSignal: "SIGKILL", encoding: "utf8", env: { ...process.env, CARDAN_CACHE: "off" }, maxBuffer: 1 << 26 });
  return { ok: done.status === 0, late: done.error?.code === "ETIMEDOUT", skipped: done.status === 77, out: (done.stdout || "") + (done.stderr || "") };
}
const makes = (file) => run("ninja", ["-C", build, "-j", "2", ...targetsOf(file)], 3600);

/// The first test that notices a change of this file, or null.
function noticedBy(file) {
  const end = Date.now() + 1000 * kLimit, left = () => Math.max(1, (end - Date.now()) / 1000);
  for (const program of testsOf(file)) {
    const name = path.join(build, "tests", program);
    if (program === "oracle_check") {
      const vectors = path.join(source, "tests/reference/oracle");
      for (const vector of fs.readdirSync(vectors).filter((f) => f.endsWith(".json"))) {
        const r = run(name, [path.join(vectors, vector), "/dev/null"], left());
        if (!r.ok && !r.skipped) return `${program} ${vector}`;
        if (Date.now() > end) return null;
      }
      continue;
    }
    const r = run(name, ["--gtest_fail_fast"], left());
    if (r.late) return null;  // what was run until then noticed nothing
    if (!r.ok) return `${program} ${(r.out.match(/\[  FAILED  \] ([^\s,]+)/) || [, "ended"])[1]}`;
  }
  return null;
}

const log = path.join(folder, seed + ".jsonl");
const done = new Map((fs.existsSync(log) ? fs.readFileSync(log, "utf8").trim().split("\n").filter(Boolean) : []).map((line) => [JSON.parse(line).n, JSON.parse(line)]));
const files = kFolders.flatMap(sources), all = files.flatMap(placesIn), random = generator(Number(seed));
console.log(`${all.length} places in ${files.length} files; ${count} of them, seed ${seed}; ${done.size} done before`);
for (const sound of ["core/", "bodies/modal/"].filter((file) => testsOf(file).length)) {
  const built = makes(sound);
  if (!built.ok) throw new Error("the sources do not build without a mutation:\n" + built.out.slice(-3000));
  const by = noticedBy(sound);
  if (by) throw new Error("a test fails without a mutation: " + by);
}

const chosen = new Set();
for (let n = 0; n < Number(count); ++n) {
  let i;
  do i = Math.floor(random() * all.length); while (chosen.has(i));
  chosen.add(i);
  if (done.has(n) || !testsOf(all[i].file).length) continue;
  const place = all[i], file = path.join(source, place.file), text = fs.readFileSync(file, "utf8"), began = Date.now();
  let verdict = "killed", by = null;
  try {
    fs.writeFileSync(file, text.slice(0, place.at) + place.to + text.slice(place.at + place.from.length));
    if (!makes(place.file).ok) verdict = "does not compile";
    else if (!(by = noticedBy(place.file))) verdict = "survived";
  } finally {
    fs.writeFileSync(file, text);
  }
  const line = text.split("\n")[place.line - 1].trim();
  const result = { n, verdict, by, file: place.file, line: place.line, kind: place.kind, from: place.from.trim(), to: place.to.trim(), text: line, seconds: Math.round((Date.now() - began) / 1000) };
  fs.appendFileSync(log, JSON.stringify(result) + "\n");
  done.set(n, result);
  console.log(`${n + 1}/${count} ${verdict}${by ? " by " + by : ""}: ${place.file}:${place.line} ${place.kind} "${result.from}" -> "${result.to}" (${result.seconds} s)`);
}
const results = [...done.values()], survivors = results.filter((r) => r.verdict === "survived"), counted = results.filter((r) => r.verdict !== "does not compile");
console.log(`\n${counted.length} mutants, ${counted.length - survivors.length} killed, ${survivors.length} survived:`);
for (const s of survivors) console.log(`  ${s.file}:${s.line} ${s.kind} "${s.from}" -> "${s.to}"   ${s.text}`);
process.exitCode = survivors.length ? 1 : 0;
