// Mutation of the product: signs, indices and factors at seeded places of the physics are changed, one at a time; what no test notices is listed.
// All of them are put into one copy of the sources, each behind its number, which the tests read from CARDAN_MUTANT: one build (-O1, one instruction set)
// serves all, and a mutant costs only its tests.
//   node tests/mutation/mutate.mjs FOLDER N SEED       `./dev mutate [N] [SEED]`; FOLDER/source, FOLDER/build
// FOLDER/SEED.jsonl has the results: a run that was ended goes on. FOLDER/build.log, FOLDER/unswitchable.json: places that do not compile so, others are drawn.
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { execFile, execFileSync, spawnSync } from "node:child_process";

const [folder, count, seed] = [path.resolve(process.argv[2]), Number(process.argv[3] || 200), Number(process.argv[4] || 1)];
const source = path.join(folder, "source"), build = path.join(folder, "build"), header = path.join(folder, "switch.hpp");
const kFolders = ["core/soa", "core/dynamics", "core/operators", "bodies", "hinges"];
const kLimit = 30;  // [s of processor time] of the tests of one mutant
const kShare = 5;   // [s] of a program's tests without a mutant: the slowest are left out until the others take no more
const kSlow = 200;  // [s] a third of what the slow tests of a program may take
const kSpare = 1.2; // places that are put in for each that is wanted: some do not compile
// Fastest to find something first.
const kPrograms = ["oracle_check", "test_contract", "test_sim", "test_operators", "test_properties"], kModal = ["test_modal", "test_vehicle", "test_sim"];
const programsOf = (file) => (/^bodies\/(modal|vehicle)\//.test(file) ? kModal : kPrograms);

// What stands for the text in the copy, where n is the number of the place and `rest` what follows up to the end of the statement.
const other = (i) => (i === "0" ? 1 : 0);  // of two there is no third
const sign = (m, n) => `${m[0]}cardan_mutant::Sign(${n}) * `, to = (n, a, b) => `cardan_mutant::either(${n}, ${a}, ${b})`;
const kRules = [
  ["sign", / [+-] /g, sign, (m) => (m[0] === " + " ? " - " : " + ")],
  ["sign", / [+-]= /g, (m, n, rest) => `${m[0]}cardan_mutant::Sign(${n}) * (${rest})`, (m) => (m[0] === " += " ? " -= " : " += ")],
  ["index", /\[([0-2])\](?!\s*=?\s*\{)/g, (m, n) => `[${to(n, m[1], other(m[1]))}]`, (m) => `[${other(m[1])}]`],  // but sizes of what is declared
  ["index", /\.([xyz])\(\)/g, (m, n) => `[${to(n, "xyz".indexOf(m[1]), "yxx".indexOf(m[1]))}]`, (m) => `.${"yxx"["xyz".indexOf(m[1])]}()`],
  ["factor", /(?<![\w.])(0\.5|2(?:\.0)?|3(?:\.0)?) \* /g, (m, n) => `${to(n, m[1], m[1].includes(".") ? "1.0" : "1")} * `, () => "1 * "],
];
const kSwitch = `#pragma once
#include <cstdlib>
namespace cardan_mutant {
inline const int on = std::getenv("CARDAN_MUTANT") ? std::atoi(std::getenv("CARDAN_MUTANT")) : 0;
template <class T>
[[gnu::always_inline]] inline T either(int n, T sound, T mutant) {
  return n == on ? mutant : sound;
}
struct Sign {
  [[gnu::always_inline]] explicit Sign(int n) : changed(n == on) {}
  bool changed;
};
template <class X>
[[gnu::always_inline]] inline auto operator*(Sign s, const X& x) {
  if constexpr (requires { x.derived().rows(); }) {  // Eigen: stays an expression
    return typename X::Scalar(s.changed ? -1 : 1) * x;
  } else if constexpr (requires { X(-x); }) {
    return s.changed ? X(-x) : x;
  } else if constexpr (requires { X(x - x - x); }) {
    return s.changed ? X(x - x - x) : x;
  } else {
    return s.changed ? -x : +x;
  }
}
}  // namespace cardan_mutant
`;

/// Code alone: comments, texts and what the preprocessor reads are blanked, character by character.
function codeOf(text) {
  const blank = (part) => part.replace(/[^\n]/g, " ");
  return text.replace(/\/\/[^\n]*|\/\*[\s\S]*?\*\/|R"(\w*)\([\s\S]*?\)\1"|"(\\.|[^"\\\n])*"|'(\\.|[^'\\\n])'|^\s*#[^\n]*/gm, blank);
}
/// Not physics: loops, sizes, texts, refusals, operation counts, includes of hinges' tables.
const isPlumbing = (line) => /\bfor \(|static_cast|size\(\)|fmt::|std::string|refuse|reserve|static_assert|throw |constexpr (int|std)|iterator|\.begin|\.end|offset|kernel_cost|cost/.test(line);

/// The end of the expression that begins at `at`: before the `;`, `,` or bracket that is not of it.
function endOf(code, at) {
  for (let depth = 0; at < code.length; ++at) {
    if ("([{".includes(code[at])) ++depth;
    if (")]}".includes(code[at]) && --depth < 0) return at;
    if (!depth && ";,".includes(code[at])) return at;
  }
  return at;
}

function placesIn(file) {
  const text = fs.readFileSync(file, "utf8"), code = codeOf(text), lines = code.split("\n"), places = [];
  for (const [kind, pattern, , change] of kRules)
    for (const m of code.matchAll(pattern)) {
      const line = code.slice(0, m.index).split("\n").length;
      if (isPlumbing(lines[line - 1]) || (kind === "sign" && !/[\w)\]}]/.test(code[m.index - 1]))) continue;
      places.push({ file, kind, line, at: m.index, from: m[0].trim(), to: change(m).trim(), text: text.split("\n")[line - 1].trim() });
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

/// The file with these of its places behind their numbers, with its lines where they were.
function switched(file, places) {
  const text = fs.readFileSync(file, "utf8"), code = codeOf(text);
  const edit = (from, end) => {  // places within what a place takes are changed too
    let out = "", at = from;
    for (const place of places.filter((p) => p.at >= from && p.at < end)) {
      if (place.at < at) continue;
      const [m, stands] = kRules.filter(([kind]) => kind === place.kind).map(([, pattern, stands]) => [text.slice(place.at).match(`^(?:${pattern.source})`), stands]).find(([m]) => m);
      const after = place.at + m[0].length, wraps = stands.length > 2, stop = wraps ? endOf(code, after) : after;
      out += text.slice(at, place.at) + stands(m, place.n, wraps ? edit(after, stop) : "");
      at = stop;
    }
    return out + text.slice(at, end);
  };
  return `#include "${header}"\n#line 1\n${edit(0, text.length)}`;
}

function sources(dir) {
  return fs.readdirSync(dir, { withFileTypes: true }).flatMap((entry) => {
    const name = path.join(dir, entry.name);
    return entry.isDirectory() ? sources(name) : /\.(cpp|hpp)$/.test(name) && !/cost|counted|help|kernels\.cpp|register/.test(name) ? [name] : [];
  }).sort();
}

/// Writes what differs: what is as it was keeps its time.
function write(name, content) {
  if (fs.existsSync(name) && fs.readFileSync(name).equals(Buffer.from(content))) return;
  fs.mkdirSync(path.dirname(name), { recursive: true });
  fs.writeFileSync(name, content);
}
const read = (name, none) => (fs.existsSync(name) ? JSON.parse(fs.readFileSync(name, "utf8")) : none);

const key = (p) => [p.file, p.from, p.text].join(":");

/// Builds all places into one program, but those that do not compile so; the first `count` of the others, as they were drawn.
function built(drawn) {
  const given = path.join(folder, "unswitchable.json"), tracked = execFileSync("git", ["ls-files", "-z"], { encoding: "utf8" }).split("\0").filter((f) => f && fs.existsSync(f));
  const bad = new Set(read(given, []));
  write(header, kSwitch);
  for (;;) {
    const put = drawn.filter((p) => !bad.has(key(p))), of = (file) => put.filter((p) => p.file === file).sort((a, b) => a.at - b.at);
    for (const file of tracked) write(path.join(source, file), of(file).length ? switched(file, of(file)) : fs.readFileSync(file));
    if (!fs.existsSync(path.join(build, "build.ninja"))) {
      const kernels = /\bavx2\b/.test(fs.readFileSync("/proc/cpuinfo", "utf8")) ? "v3" : "v2";
      execFileSync("cmake", ["-S", source, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Mutants", "-DCMAKE_CXX_FLAGS=-w", "-DCMAKE_CXX_FLAGS_MUTANTS=-O1 -DNDEBUG", "-DCARDAN_UNITY=ON", `-DCARDAN_KERNELS=${kernels}`], { stdio: "ignore" });
    }
    const make = spawnSync("ninja", ["-C", build, "-k", "0", "-j", String(os.cpus().length), ...new Set([...kPrograms, ...kModal]), "custom_cam"], { encoding: "utf8", maxBuffer: 1 << 28 });
    fs.writeFileSync(path.join(folder, "build.log"), make.stdout + make.stderr);
    if (make.status === 0) {
      if (!make.stdout.includes("no work to do")) fs.rmSync(path.join(folder, "tests.json"), { force: true });
      return put;
    }
    const told = make.stdout.replace(/\x1b\[[\d;]*[mK]/g, "").split("\n").filter((line) => line.includes(source));
    for (const which of [told.filter((line) => line.includes(" error: ")), told]) {  // where the error is, else where it came from
      const at = new Set(which.flatMap((line) => [...line.matchAll(/([^\s:]+):(\d+)/g)].map((m) => `${path.relative(source, m[1])}:${m[2]}`)));
      const faulty = put.filter((p) => at.has(`${p.file}:${p.line}`));
      for (const p of faulty) bad.add(key(p));
      if (faulty.length) break;
      if (which === told) throw new Error("the copy does not build: see " + path.join(folder, "build.log"));
    }
    fs.writeFileSync(given, JSON.stringify([...bad], null, 1));
    console.log(`${bad.size} places do not compile behind a number`);
  }
}

/// What `work` gives for each, as many at once as there are cores.
async function forAll(items, work) {
  const out = [];
  let next = 0;
  await Promise.all(os.cpus().map(async () => {
    for (let i = next++; i < items.length; i = next++) out[i] = await work(items[i], i);
  }));
  return out;
}

/// Runs a program for at most so many seconds of processor time; and a hundred of the clock for each, should it sleep.
async function run([command, ...args], seconds, mutant) {
  const limits = `ulimit -v 8000000 -t ${Math.max(1, Math.ceil(seconds))}; "$0" "$@"; status=$?; times >&2; exit $status`;
  const env = { ...process.env, CARDAN_CACHE: "off", CARDAN_MUTANT: String(mutant) };
  const options = { timeout: Math.ceil(1e5 * seconds), killSignal: "SIGKILL", env, maxBuffer: 1 << 26 };
  const [status, out, told] = await new Promise((end) => execFile("bash", ["-c", limits, command, ...args], options, (error, ...texts) => end([error ? error.code : 0, ...texts])));
  const used = told.match(/(\d+)m([\d.]+)s (\d+)m([\d.]+)s\s*$/);
  const cpu = used ? 60 * used[1] + Number(used[2]) + 60 * used[3] + Number(used[4]) : seconds;
  return { ok: status === 0 || status === 77, late: !used || cpu >= seconds, cpu, out };
}

/// The commands of a program, each with the time that it takes without a mutant: of the test programs without their slowest tests.
async function commandsOf(program) {
  const name = path.join(build, "tests", program), vectors = path.join(source, "tests/reference/oracle");
  const sound = async (command) => {
    const r = await run(command, 1200, 0);
    if (!r.ok) throw new Error(`${command.join(" ")} fails without a mutant:\n${r.out.slice(-3000)}`);
    return r;
  };
  if (program === "oracle_check")
    return forAll(fs.readdirSync(vectors).filter((f) => f.endsWith(".json")).map((f) => [name, path.join(vectors, f), "/dev/null"]), async (command) => ({ program, command, cpu: (await sound(command)).cpu }));
  const whole = await sound([name]), busy = (1000 * whole.cpu) / Number(whole.out.match(/ran\. \((\d+) ms total\)/)[1]);  // of the clock's time, on a machine that others use
  const tests = [...whole.out.matchAll(/\[       OK \] ([^\s,]+).*\((\d+) ms\)/g)].map((m) => [m[1], (busy * m[2]) / 1000]).sort((a, b) => a[1] - b[1]);
  let sum = 0;
  const slow = tests.filter(([, seconds]) => (sum += seconds) > kShare).map(([test]) => test);
  const command = [name, "--gtest_fail_fast", `--gtest_filter=-${slow.join(":")}`];
  return [{ program, command, slow, cpu: (await sound(command)).cpu }];
}

/// The first test that notices, or null. A program that takes three times as long as without a mutant hangs, which is noticed too.
async function tested(place, commands, limit = kLimit) {
  let used = 0;
  const seconds = () => Math.round(10 * used) / 10;
  for (const { program, command, cpu } of commands.filter((c) => programsOf(place.file).includes(c.program))) {
    const hangs = 3 * cpu + 1, r = await run(command, Math.min(hangs, limit - used), place.n);
    used += r.cpu;
    if (used >= limit && r.cpu < hangs) break;
    const by = r.late ? "(time)" : program === "oracle_check" ? path.basename(command[1]) : (r.out.match(/\[  FAILED  \] ([^\s,]+)/) || [, "(ended)"])[1];
    if (!r.ok) return { by: `${program} ${by}`, seconds: seconds() };
  }
  return { by: null, seconds: seconds() };
}

const files = kFolders.flatMap(sources), all = files.flatMap(placesIn), random = generator(seed), drawn = new Set();
while (drawn.size < Math.min(all.length, Math.ceil(kSpare * count))) drawn.add(Math.floor(random() * all.length));
const put = built([...drawn].map((i) => ({ ...all[i], n: i + 1 }))), switchable = put.length, mutants = put.slice(0, count);
console.log(`${all.length} places in ${files.length} files; ${mutants.length} of them, seed ${seed}`);
const timed = path.join(folder, "tests.json"), log = path.join(folder, seed + ".jsonl");
let before = fs.existsSync(log) ? fs.readFileSync(log, "utf8").split("\n").filter(Boolean).map((line) => JSON.parse(line)) : [];
if (!fs.existsSync(timed)) {  // built anew: there may be tests that notice what survived
  write(log, (before = before.filter((r) => r.by)).map((r) => JSON.stringify(r) + "\n").join(""));
  write(timed, JSON.stringify((await forAll([...new Set([...kPrograms, ...kModal])], commandsOf)).flat(), null, 1));
}
const commands = read(timed);
const results = await forAll(mutants, async (place, i) => {
  const old = before.findLast((r) => r.n === place.n && key(r) === key(place));
  return old || told({ ...place, ...(await tested(place, commands)) }, i);
});
/// Survivors meet the slow tests too, which are not in the limit of a mutant.
const slow = commands.filter((c) => c.slow?.length).map((c) => ({ ...c, command: [c.command[0], "--gtest_fail_fast", `--gtest_filter=${c.slow.join(":")}`], cpu: kSlow }));
await forAll(results, async (r, i) => {
  if (!r.by && !r.slow) results[i] = told({ ...r, ...(await tested(r, slow, Infinity)), seconds: r.seconds, slow: true }, i);
});

/// Keeps a result, and shows it.
function told(r, i) {
  fs.appendFileSync(log, JSON.stringify(r) + "\n");
  console.log(`${i + 1}/${mutants.length} ${r.by ? "killed by " + r.by : "survived"}: ${r.file}:${r.line} ${r.kind} "${r.from}" -> "${r.to}" (${r.seconds} s)`);
  return r;
}
const survivors = results.filter((r) => !r.by), seconds = results.map((r) => r.seconds);
const by = [...new Set(results.filter((r) => r.by).map((r) => r.by.split(" ")[0]))].map((program) => `${results.filter((r) => r.by?.startsWith(program)).length} by ${program}`);
console.log(`\n${results.length} mutants, ${results.length - survivors.length} killed (${by.join(", ")}; ${results.filter((r) => r.by && r.slow).length} by slow tests alone), ${survivors.length} survived`);
console.log(`${(seconds.reduce((a, b) => a + b) / results.length).toFixed(1)} s of processor time each, ${Math.max(...seconds)} s at most; ${all.length} places, of ${drawn.size} drawn ${drawn.size - switchable} do not compile behind a number`);
for (const s of survivors) console.log(`  ${s.n}: ${s.file}:${s.line} ${s.kind} "${s.from}" -> "${s.to}"   ${s.text}`);
process.exitCode = survivors.length ? 1 : 0;
