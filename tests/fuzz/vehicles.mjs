// Random vehicles by the program as users have it: node tests/fuzz/vehicles.mjs [SCENES] [FIRST SEED] [FOLDER]
// Trees of three to six bodies, rigid and flexible, with what stands at hinges and between nodes, given motions, loops and hinges that lock
// in flight. Each runs by dopri5 beside the dense twin, by dop853, stopped and resumed (the same bits), and by dop853 with bodies, devices
// and loops in another order and the loops closed in the other form. What differs, or leaves its balances (W0402), is kept in the folder
// and the exit code is 1. Counted are starts that do not close and motions that end at a singular posture, as the lock of a gimbal, or crawl
// by one for more than 60 s.
import { spawnSync } from "node:child_process";
import { mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";

const [scenes = "40", firstSeed = "1", folder = "build/vehicles"] = process.argv.slice(2);
const program = "build/cardan";

/// Numbers of one seed (mulberry32).
class Draw {
  constructor(seed) { this.state = seed >>> 0; }
  unit() {
    this.state = (this.state + 0x6d2b79f5) >>> 0;
    let t = this.state;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  }
  between(low, high) { return low + (high - low) * this.unit(); }
  chance(share) { return this.unit() < share; }
  of(list) { return list[Math.floor(this.unit() * list.length)]; }
  vector(size) { return [0, 1, 2].map(() => this.between(-size, size)); }
  direction() {
    for (;;) {
      const v = this.vector(1), n = Math.hypot(...v);
      if (n > 0.1 && n < 1) return v.map((x) => x / n);
    }
  }
  across(a) {
    const b = this.direction(), d = a.reduce((sum, x, i) => sum + x * b[i], 0), c = b.map((x, i) => x - d * a[i]), n = Math.hypot(...c);
    return n > 0.3 ? c.map((x) => x / n) : this.across(a);
  }
  shuffled(object) {
    return Object.fromEntries(Object.entries(object).map((e) => [this.unit(), e]).sort((a, b) => a[0] - b[0]).map((e) => e[1]));
  }
}

// Of each hinge type that moves: coordinates, their velocities, and which of them turn.
const hinges = {
  revolute: [["angle"], ["rate"], [1]],
  prismatic: [["displacement"], ["rate"], [0]],
  helical: [["angle"], ["rate"], [1]],
  cylindrical: [["angle", "displacement"], ["rate", "speed"], [1, 0]],
  universal: [["angle_1", "angle_2"], ["rate_1", "rate_2"], [1, 1]],
  planar: [["x", "y", "angle"], ["vx", "vy", "rate"], [0, 0, 1]],
  gimbal: [["angle_1", "angle_2", "angle_3"], ["rate_1", "rate_2", "rate_3"], [1, 1, 1]],
  translational: [["x", "y", "z"], ["vx", "vy", "vz"], [0, 0, 0]],
  ball: [["wx", "wy", "wz"], ["wx", "wy", "wz"], [1, 1, 1]],
};

function hingeOf(draw, type, motions, name, isBase) {
  const hinge = { type };
  const axis = draw.direction();
  if (["revolute", "prismatic", "helical", "cylindrical"].includes(type)) hinge.axis = axis;
  if (type === "helical") hinge.pitch = draw.between(-0.05, 0.05);
  if (type === "universal" || type === "planar") hinge.axes = [axis, draw.across(axis)];
  if (type === "gimbal") hinge.axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  if (!hinges[type]) return { hinge, components: [] };
  const initial = {}, components = [], springs = [], loads = [], prescribed = [];
  hinges[type][0].forEach((q, i) => {
    const v = hinges[type][1][i], turns = hinges[type][2][i], size = turns ? 1 : 0.5, isBall = type === "ball";
    if (!isBall) initial[q] = size * draw.between(-0.4, 0.4);
    initial[v] = size * draw.between(-0.8, 0.8);
    const component = { body: name, q, v, turns, at: hinges[type][0].length > 1 ? `${name}.${q}` : name, given: false };
    if (!isBase && !isBall && draw.chance(0.15)) {
      component.given = true;
      prescribed.push(v);
      if (draw.chance(0.5)) {
        const to = () => size * draw.between(-1, 1);
        motions.push(`v:hinge("${name}"):profile{ component = "${v}", rate_table = { {0, ${initial[v]}}, {0.3, ${to()}}, {0.8, ${to()}} } }`);
      } else {
        const amplitude = draw.between(0.02, 0.15), frequency = draw.between(0.5, 2), phase = draw.between(0, 3);
        initial[v] = amplitude * 2 * Math.PI * frequency * Math.cos(phase);
        motions.push(`v:hinge("${name}"):profile{ component = "${v}", sine = { amplitude = ${amplitude}, frequency = ${frequency}, phase = ${phase} } }`);
      }
    }
    if (!isBase && isBall && draw.chance(0.3)) springs.push({ component: v, stiffness: 0, damping: draw.between(0.05, 0.4) });
    if (!isBase && !isBall && draw.chance(0.6))
      springs.push({ component: q, stiffness: draw.between(5, 40), rest: draw.between(-0.2, 0.2), damping: draw.of([0, draw.between(0.05, 0.5)]) });
    if (!isBase && !isBall && draw.chance(0.15))
      loads.push({ type: "stop", component: q, upper: initial[q] + draw.between(0.05, 0.2), stiffness: draw.between(200, 900), exponent: draw.of([1, 1.5]), dissipation: draw.of([0, 0.3]) });
    else if (!isBase && !isBall && !component.given && draw.chance(0.1))
      loads.push({ type: "hard_stop", component: q, lower: initial[q] - draw.between(0.05, 0.2), stiffness: draw.between(500, 2000), restitution: draw.between(0.2, 1), speed: 0.01 });
    if (!isBase && draw.chance(0.12)) loads.push({ type: "friction", component: isBall ? v : q, coulomb: draw.between(0.01, 0.3), width: draw.between(0.05, 0.2), viscous: draw.between(0, 0.1) });
    components.push(component);
  });
  hinge.initial = type === "ball" ? { orientation: { rotvec: draw.vector(0.6) }, rate: [initial.wx, initial.wy, initial.wz] } : initial;
  if (springs.length) hinge.springs = springs;
  if (loads.length) hinge.loads = loads;
  if (prescribed.length) hinge.prescribed = prescribed;
  return { hinge, components };
}

function bodyOf(draw, isBase) {
  if (!isBase && draw.chance(0.2)) {
    const length = draw.between(1, 3), level = draw.of([0, 1, 2]);
    const modal = { beam: { length, material: { E: 7e10, nu: 0.3, rho: 2700 }, section: { tube: { radius: 0.03, wall: 0.002 } } }, boundary: "cantilever",
                    modes: { count: draw.of([2, 3, 4, 5]) }, damping: draw.of([0, 0.01]), nodes: { p: { position: [length, 0, 0] }, s: { position: [length / 2, 0, 0] } } };
    return { type: "modal_flexible", level, ...(level === 2 ? { rotary_inertia: 0.1 } : {}), modal };
  }
  const mass = draw.between(0.5, 5), [x, y, z] = [0, 1, 2].map(() => 0.2 * mass * draw.between(0.1, 1));
  return { mass, com: draw.vector(0.2), inertia: [y + z, x + z, x + y],
           nodes: { p: { position: draw.vector(0.6) }, s: { position: draw.vector(0.6), orientation: { rotvec: draw.vector(1) } } } };
}

function devicesOf(draw, bodies, components) {
  const devices = {}, names = Object.keys(bodies);
  const add = (device) => { devices[`d${Object.keys(devices).length}`] = device; };
  const at = () => `${draw.of(names)}.${draw.of(["p", "s"])}`;
  const two = () => {
    const from = draw.of(names), to = draw.of(names.filter((n) => n !== from));
    return { from: `${from}.${draw.of(["p", "s"])}`, to: `${to}.${draw.of(["p", "s"])}` };
  };
  const three = (low, high) => [0, 1, 2].map(() => draw.between(low, high));
  if (draw.chance(0.4)) add({ type: "spring_damper", ...two(), stiffness: draw.between(5, 60), damping: draw.between(0, 2) });
  if (draw.chance(0.3)) add({ type: "cable", ...two(), stiffness: draw.between(20, 100), length: draw.between(0.1, 0.9), damping: draw.between(0, 1) });
  if (draw.chance(0.2)) add({ type: "bushing", ...two(), stiffness: three(5, 30), turn_stiffness: three(1, 9), damping: three(0, 1), turn_damping: three(0, 0.4) });
  if (draw.chance(0.3)) add({ type: "momentum_wheel", at: at(), axis: draw.direction(), inertia: draw.between(0.01, 0.1), inputs: { torque: draw.between(-0.3, 0.3) }, initial: { momentum: draw.between(-1, 1) } });
  const rigid = names.filter((n) => bodies[n].mass);
  if (draw.chance(0.2)) {
    add({ type: "thruster", at: at(), thrust: draw.between(0.5, 4), specific_impulse: draw.between(0.5, 3), direction: draw.direction(), inputs: { command: draw.between(0.2, 1), supply: "tank.supply" } });
    const flow = `d${Object.keys(devices).length - 1}.flow`;
    devices.tank = { type: "tank", at: draw.of(rigid), radius: 0.2, position: draw.vector(0.2), density: 1000, fill: draw.of(["even", "ball"]), initial: { propellant: draw.between(3, 8) }, inputs: { flow } };
  }
  const free = components.filter((c) => !c.given && c.q !== c.v), turning = free.filter((c) => c.turns);
  if (turning.length && draw.chance(0.15)) add({ type: "tape_spring", at: draw.of(turning).at, peak_moment: draw.between(0.5, 2), peak_angle: 0.15, steady_moment: draw.between(0.1, 0.4), damping: draw.between(0, 0.1) });
  if (turning.length && draw.chance(0.2)) add({ type: "dc_motor", at: draw.of(turning).at, constant: draw.between(0.05, 0.3), resistance: 1, inductance: draw.between(0.01, 0.1), gear: draw.of([1, 3]), inputs: { voltage: draw.between(-3, 3) } });
  if (free.length && draw.chance(0.15)) add({ type: "lugre_friction", at: draw.of(free).at, coulomb: draw.between(0.05, 0.3), stiffness: draw.between(50, 200), damping: draw.between(0.1, 1), stribeck_rate: 0.01 });
  if (free.length && draw.chance(0.15)) add({ type: "dry_friction", at: draw.of(free).at, coulomb: draw.between(0.05, 0.5), viscous: draw.between(0, 0.1) });
  if (draw.chance(0.25))
    add({ type: "contact", ...two(), from_shape: "sphere", from_radius: draw.between(0.1, 0.4), to_shape: "sphere", to_radius: draw.between(0.1, 0.4), stiffness: draw.between(100, 1000), at_depth: 0.05,
          restitution: draw.of([1, 0.6]), speed: 0.3, friction: draw.of([0, 0.3]), width: 0.1, max_depth: 0.9 });
  return devices;
}

/// A coupling of two coordinates, closed as they stand, or a strut as long as its ends are apart; rates that nothing gives go with it.
function loopsOf(draw, bodies, components, motions) {
  const forget = () => {
    for (const name of Object.keys(bodies))
      if (name !== "b0" && !components.some((c) => c.given && c.body === name))
        for (const key of Object.keys(bodies[name].hinge.initial ?? {}))
          if (["rate", "speed", "rate_1", "rate_2", "rate_3", "vx", "vy", "vz"].includes(key)) delete bodies[name].hinge.initial[key];
  };
  const given = (loop, name) => {
    loop.prescribed = true;
    motions.push(`v:loop("${name}"):profile{ sine = { amplitude = ${draw.between(0.02, 0.1)}, frequency = ${draw.between(0.5, 2)}, phase = ${draw.between(0, 3)} } }`);
  };
  if (draw.chance(0.2)) {
    const names = Object.keys(bodies), from = draw.of(names), to = draw.of(names.filter((n) => n !== from));
    const strut = { type: "distance", from: `${from}.${draw.of(["p", "s"])}`, to: `${to}.${draw.of(["p", "s"])}` };
    if (draw.chance(0.3)) given(strut, "strut");
    forget();
    return { strut };
  }
  const free = components.filter((c) => !c.given && c.q !== c.v);
  if (free.length < 2 || !draw.chance(0.4)) return {};
  const a = draw.of(free), b = draw.of(free.filter((c) => c !== a)), ratio = draw.between(0.5, 2) * draw.of([-1, 1]);
  const angle = bodies[a.body].hinge.initial[a.q];
  const coupling = { type: "coupling", terms: { [a.at]: 1, [b.at]: ratio }, offset: angle + ratio * bodies[b.body].hinge.initial[b.q] };
  if (draw.chance(0.4)) {
    const sine = draw.between(0.02, 0.2);
    coupling.functions = [{ of: { [a.at]: 1 }, sine }];
    coupling.offset += sine * Math.sin(angle);
  }
  forget();
  if (draw.chance(0.4)) given(coupling, "gear");
  return { gear: coupling };
}

function sceneOf(seed) {
  const draw = new Draw(seed), motions = [], bodies = {}, components = [], figures = [];
  const base = draw.of(["free", "free_body", "ball", "universal", "revolute"]), isFree = base.startsWith("free"), inOrbit = isFree && draw.chance(0.2);
  const count = draw.of([3, 4, 5, 6]);
  for (let i = 0; i < count; ++i) {
    const name = `b${i}`, type = i === 0 ? base : draw.of([...Object.keys(hinges), "revolute", "locked"]);
    const body = bodyOf(draw, i === 0), parent = `b${Math.floor(draw.unit() * i)}`;
    const made = hingeOf(draw, type, motions, name, i === 0);
    made.hinge.to = i === 0 ? "world" : `${parent}.${draw.of(["p", "s"])}`;
    if (body.type) made.hinge.at = "root";
    else if (draw.chance(0.4)) made.hinge.at = { position: draw.vector(0.3), orientation: { rotvec: draw.vector(0.6) } };
    if (i === 0 && isFree)
      made.hinge.initial = { position: [inOrbit ? 7e6 : 0, 0, 0].map((x) => x + draw.between(-0.5, 0.5)), rate: draw.vector(0.5), velocity: [0, inOrbit ? 7546 : 0, 0].map((x) => x + draw.between(-0.3, 0.3)) };
    bodies[name] = { ...body, hinge: made.hinge };
    components.push(...made.components);
    const moves = isFree && i === 0 ? 7 : type === "ball" ? 4 : made.components.length;
    for (let k = 1; k <= moves; ++k) figures.push(`figure { name = "${name}.${k}", value = function() return v:hinge("${name}"):q(${k}) end }`);
  }
  const loops = loopsOf(draw, bodies, components, motions), devices = devicesOf(draw, bodies, components);
  const lockable = Object.keys(bodies).filter((n) => n !== "b0" && bodies[n].hinge.type !== "locked" && !components.some((c) => c.body === n && c.given) && !JSON.stringify(loops).includes(n));
  if (lockable.length && draw.chance(0.3)) {
    const name = draw.of(lockable), t = draw.between(0.2, 0.5);
    [["lock", t], ["unlock", t + draw.between(0.1, 0.4)]].forEach(([what, when]) =>
      motions.push(`event { name = "${what}", when = function(t) return t - ${when} end, once = true, direction = "rising", action = function() v:${what}("${name}") end }`));
  }
  const gravity = inOrbit ? { central: { mu: 3.986004418e14 } } : draw.of(["none", { uniform: draw.vector(5) }]);
  const vehicle = { cardan: 1, gravity, bodies };
  if (Object.keys(devices).length) vehicle.devices = devices;
  if (Object.keys(loops).length) Object.assign(vehicle, { loops, loop_form: draw.of(["embedding", "multipliers"]) });
  const other = { ...vehicle, bodies: draw.shuffled(bodies) };
  if (vehicle.devices) other.devices = draw.shuffled(devices);
  if (vehicle.loops) other.loop_form = vehicle.loop_form === "embedding" ? "multipliers" : "embedding";
  return { vehicle, other, script: [...motions, ...figures].join("\n"), stop: draw.between(0.2, 0.8) };
}

function run(place, ...options) {
  const out = `${place}/out`;
  rmSync(out, { recursive: true, force: true });
  const ended = spawnSync(program, ["run", ...options, "--out", out, "--no-report", "--quiet"], { encoding: "utf8", timeout: 60000 });
  try {
    return { ...JSON.parse(readFileSync(`${out}/summary.json`, "utf8")), text: ended.stderr };
  } catch {
    return { refused: true, text: ended.stderr || "no answer in 60 s" };
  }
}
function scenario(place, vehicle, script, method, relative) {
  mkdirSync(place, { recursive: true });
  writeFileSync(`${place}/vehicle.yaml`, JSON.stringify(vehicle, null, 1));
  writeFileSync(`${place}/scenario.lua`, `local v = vehicle "vehicle.yaml"\nmission { duration = 1, integrator = { method = "${method}", relative = ${relative} } }\n${script}\n`);
  return place;
}
function lengthOf(place, { bodies }, { from, to }) {
  const script = `local a, b = { v:node("${from}"):position() }, { v:node("${to}"):position() }\nprint(string.format("LENGTH %.17g", math.sqrt((a[1] - b[1]) ^ 2 + (a[2] - b[2]) ^ 2 + (a[3] - b[3]) ^ 2)))`;
  const said = spawnSync(program, ["check", scenario(place, { cardan: 1, bodies }, script, "dopri5", 1e-9)], { encoding: "utf8" });
  return Number((said.stdout + said.stderr).match(/LENGTH (\S+)/)[1]);
}
const away = (a, b) => Math.max(0, ...a.figures.map((f, i) => Math.abs(f.value - b.figures.find((g) => g.name === f.name).value) / Math.max(1, Math.abs(f.value))));

/// What is wrong with a scene, or null; or a word for one that tells nothing.
function look(seed) {
  const { vehicle, other, script, stop } = sceneOf(seed), place = `${folder}/${seed}`;
  if (vehicle.loops?.strut) vehicle.loops.strut.length = lengthOf(`${place}/length`, vehicle, vehicle.loops.strut);
  const twin = run(scenario(`${place}/dopri5`, vehicle, script, "dopri5", 1e-9), `${place}/dopri5`, "--check-against-reference");
  if (twin.refused && /error\[C110[23]\]|failure\[N0[56]01\]/.test(twin.text)) return "refused";
  if (twin.refused) return { fault: twin.text };
  if (twin.failure) return /N0(107|201|202|501|601)/.test(twin.failure.code) ? "ended" : { fault: twin.text };
  if (twin.verdict === "interrupted") return "ended";
  if (twin.verdict !== "passed") return { fault: `beside the dense twin: ${JSON.stringify(twin.checks)}` };
  const whole = run(scenario(`${place}/dop853`, vehicle, script, "dop853", 1e-11), `${place}/dop853`);
  const half = run(scenario(`${place}/half`, vehicle, script, "dop853", 1e-11), `${place}/half`, "--until", `${stop}`);
  const resumed = half.failure ? half : run(`${place}/resumed`, "--resume", `${place}/half/out`);
  const shuffled = run(scenario(`${place}/other`, other, script, "dop853", 1e-11), `${place}/other`);
  for (const r of [whole, half, resumed, shuffled]) {
    if (r.verdict === "interrupted") return "ended";
    if (r.refused || r.failure) return { fault: r.text };
  }
  for (const r of [twin, whole, shuffled])
    if (r.warnings.some((w) => w.code === "W0402")) return { fault: `W0402: ${JSON.stringify(r.ledger)}` };
  if (resumed.hashes.final_state !== whole.hashes.final_state) return { fault: `resumed at ${stop} s it ends otherwise` };
  if (away(whole, twin) > 1e-4) return { fault: `dopri5 and dop853 differ by ${away(whole, twin)}` };
  if (away(whole, shuffled) > 1e-6) return { fault: `in another order it differs by ${away(whole, shuffled)}` };
  rmSync(place, { recursive: true });
  return null;
}

const counts = { right: 0, refused: 0, ended: 0, wrong: 0 };
for (let seed = Number(firstSeed); seed < Number(firstSeed) + Number(scenes); ++seed) {
  const found = look(seed);
  if (found === null) ++counts.right;
  else if (typeof found === "string") ++counts[found], rmSync(`${folder}/${seed}`, { recursive: true });
  else ++counts.wrong, console.log(`${folder}/${seed}: ${found.fault.trim()}`);
}
console.log(`${scenes} vehicles from seed ${firstSeed} on: ${counts.right} right, ${counts.refused} do not close, ${counts.ended} end at a singular posture, ${counts.wrong} wrong`);
process.exit(counts.wrong > 0 ? 1 : 0);
