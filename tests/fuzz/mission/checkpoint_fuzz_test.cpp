// Checkpoints: as results hold them, as texts and as blocks, each resumed and run on from.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "core/io/checkpoint_text.hpp"
#include "core/io/range_recorder.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/mission/examine.hpp"
#include "scripts/mission/mission_run.hpp"
#include "scripts/mission/run_again.hpp"
#include "scripts/mission/workbench.hpp"
#include "tests/fuzz/hdf5_mutations.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using fuzz::Keep;
using fuzz::Random;

/// Something of each block of a checkpoint: modes, a motion as points and one as a sine, laws of hinges with corners.
const char* kVehicle = R"(cardan: 1
gravity: {uniform: [0, 0, -9.81]}
bodies:
  bus: {mass: 100 kg, inertia: [10, 12, 14], hinge: {type: free, to: world, initial: {angular_velocity: [0, 0, 1 deg/s]}}}
  arm:
    type: modal_flexible
    level: 1
    modal:
      lumped:
        masses:
          - {mass: 1, position: [1, 0, 0], Phi: [[0, 0], [0, 1], [1, 0]]}
          - {mass: 2, position: [2, 0, 0], inertia: [0.1, 0.1, 0.1], Phi: [[0, 0], [0, 3], [2, 0]]}
        K: [[4, 0], [0, 9]]
        C: [[0.1, 0], [0, 0.1]]
        nodes: {end: {position: [2, 0, 0], Phi: [[0, 0], [0, 3], [2, 0]]}}
    hinge: {type: revolute, to: {body: bus, position: [0, 0, -1]}, axis: [0, 0, 1], prescribed: true}
    initial: {eta: [0.3, 0], etadot: [0, 0]}
  wheel: {mass: 3 kg, inertia: [0.02, 0.02, 0.03], hinge: {type: revolute, to: bus, axis: [1, 0, 0], prescribed: true}}
  flap:
    mass: 2 kg
    com: [0.3, 0, 0]
    inertia: [0.1, 0.3, 0.3]
    hinge:
      type: revolute
      to: bus
      axis: [0, 1, 0]
      spring: {stiffness: 10, damping: 0.1}
      loads: [{type: stop, upper: 0.02, stiffness: 1000}, {type: friction, coulomb: 0.1, width: 0.01}]
      initial: {angle: 0.01, rate: 0.3}
)";
const char* kMission = R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 2, output = { rate = "10 Hz" }, checkpoint = { period = "0.25 s" } }
sat:hinge("arm"):profile { rate_table = { { 0, 0 }, { 0.4, 0.1 }, { 2, 0 } } }
sat:hinge("wheel"):profile { sine = { amplitude = 0.1, frequency = "2 Hz" } }
local bus, flap, load = sat:body "bus", sat:hinge "flap", sat:node("arm.end"):load { axes = "world" }
local m = persist { n = 0, text = "a\0b", list = { { 1, 2 }, "b" }, v = vector { 1, 2, 3 }, act = function(x) return -x end }
m.again = m.list
local log = signals { own = { components = { "x", "y" } } }
controller { name = "c", rate = "20 Hz", step = function(t)
  m.n = m.n + 1
  m.list[#m.list % 5 + 1] = { t, math.random() }
  m.v[1], m.w, m.A = m.n, vector { t, 1 }, matrix { { 1, t }, { 0, 2 } }
  flap:torque(m.act(flap:angle()) + 0.01 * (m.list[1][2] or 0) + (mission.phase() == "push" and 0.5 or 0))
  load:set(0, 0, 0, 0.1 * math.sin(t), 0, m.A[2][2])
  log.own(m.n, 0 / 0)
end }
phase { name = "swing", duration = 0.7, exit_ = function() print(m.text, #m.list) end }
phase { name = "push", until_ = function() return m.n > 30 end }
sequence { name = "plan", run = function()
  local kept = { m.n, vector { 1, 2 } }
  for k = 1, 100 do
    if not wait_until(function() return flap:rate() - 0.001 * k end, { timeout = 0.07 }) then kept[3] = sat:hinge("flap"):angle() end
    wait(0.1 * math.random())
    wait_until(function() return m.n % 3 == 0 end, { rate = "20 Hz", timeout = "0.3 s", otherwise = function() wait(9) end })
  end
end }
sequence { name = "later", run = function() wait "1 s" m.n = m.n + 1 end }
event { name = "passes", when = function() return flap:angle() - 0.005 end, action = function() m.n = m.n + 1 end }
)lua";
const std::vector<std::vector<Setting>> kMethods = {
    {{"mission.integrator.method", "dopri5"}},
    {{"mission.integrator.method", "rk4"}, {"mission.integrator.step", "0.01 s"}},
    {{"mission.integrator.method", "cvode_adams"}},
    {{"mission.integrator.method", "cvode_bdf"}},
    {{"mission.integrator.method", "cvode_bdf"}, {"mission.integrator.linear_solver", "krylov"}}};
const std::vector<std::string> kWords = {"",
                                         "nan",
                                         "inf",
                                         "numbers",
                                         "texts",
                                         "blocks",
                                         "table new",
                                         "table 1",
                                         "table 3",
                                         "vector new 2 1",
                                         "vector new 1 2",
                                         "vector 4 3 1",
                                         "matrix 4",
                                         "matrix new 2 2",
                                         "matrix 2 0 0",
                                         "matrix new 4 0",
                                         "as set up",
                                         "again 0",
                                         "again 99",
                                         "end",
                                         "nil",
                                         "true",
                                         "i0",
                                         "i1",
                                         "i2",
                                         "i3",
                                         "i-1",
                                         "f0.5",
                                         "sx",
                                         "x00",
                                         "W0301",
                                         "C0702",
                                         "/dev/zero"};
const double kOdd[] = {0.0,  -0.0, 1.0, -1.0,     2.0,       0.5,          1e308,  -1e308, 5e-324,
                       1e18, 1e9,  NAN, HUGE_VAL, -HUGE_VAL, 2147483648.0, 0x1p53, 1e-9};

ScenarioOptions options_of(const fs::path& folder, const std::vector<Setting>& method) {
  ScenarioOptions options;
  options.file = folder / "scenario.lua";
  options.settings = method;
  return options;
}

/// Runs on from a checkpoint, for 0.3 s or 200 steps.
void resume(const ScenarioOptions& options, const Checkpoint& checkpoint) {
  NoRecorder recorder;
  const auto scenario = open_scenario(options);
  MissionRun mission(*scenario, recorder, mission_outputs(*scenario));
  mission.resume(checkpoint);
  int steps = 0;
  mission.run(scenario->sim->time() + 0.3, [&](double) {
    if (++steps == 200) scenario->sim->stop();
  });
}

void change(Checkpoint& checkpoint, const Checkpoint& other, Random& random) {
  const auto any = [&](auto& map) { return std::next(map.begin(), static_cast<std::ptrdiff_t>(random.below(map.size()))); };
  if (checkpoint.empty()) return;
  const auto script = checkpoint.find("script");  // where most of what can be wrong is
  auto& [name, block] = script != checkpoint.end() && random.one_in(3) ? *script : *any(checkpoint);
  std::vector<double>& x = block.numbers;
  std::vector<std::string>& texts = block.texts;
  const std::size_t what = random.below(12);
  if (what < 5 && !x.empty()) {
    double& number = x[random.below(x.size())];
    number = random.one_in(3) ? random.of(kOdd) : random.one_in(3) ? -number : random.one_in(2) ? number + 1.0 : number * 1.5;
  } else if (what < 8 && !texts.empty()) {
    std::string& text = texts[random.below(texts.size())];
    text = random.one_in(3) ? random.of(texts) : random.one_in(2) ? random.of(kWords) : fuzz::mutated(text, kWords, kWords, random);
  } else if (what == 8 && !x.empty()) {
    const auto at = x.begin() + static_cast<std::ptrdiff_t>(random.below(x.size()));
    random.one_in(2) ? x.erase(at) : x.insert(at, random.of(kOdd));
  } else if (what == 9 && !texts.empty()) {
    const auto at = texts.begin() + static_cast<std::ptrdiff_t>(random.below(texts.size()));
    random.one_in(2) ? texts.erase(at) : texts.insert(at, random.of(kWords));
  } else if (what == 10 && other.contains(name)) {  // of another time, or of another method
    block = other.at(name);
  } else if (what == 11 && random.one_in(3)) {
    checkpoint.erase(name);
  }
}

/// As the program answers it.
template <class Part>
void answered(const Part& part) {
  try {
    part();
  } catch (const CheckpointFault& fault) {
    refuse(Code::bad_result_file, {"/restart/checkpoints/text", {"run.h5"}}, "what the scenario in these results makes", fault.what());
  }
}

TEST(Fuzz, Checkpoint) {
  const fs::path folder = test::scratch("checkpoints");
  fs::remove_all(folder);
  fs::create_directories(folder);
  fuzz::write(folder / "vehicle.yaml", kVehicle);
  fuzz::write(folder / "scenario.lua", kMission);
  std::vector<std::vector<std::string>> seeds;  // of each method
  std::vector<std::string> all, results;
  const std::string h5 = folder / "run.h5";
  for (const std::vector<Setting>& method : kMethods) {
    const auto scenario = open_scenario(options_of(folder, method));
    const auto file = make_hdf5_recorder(h5);
    RangeRecorder recorder(*file);
    std::vector<Output> outputs = mission_outputs(*scenario);
    std::vector<Channel> channels;
    for (const Output& o : outputs) channels.push_back(o.channel);
    RunHeader header = run_header(*scenario);
    header.command = {"cardan", "run"};
    recorder.begin(header, channels);
    MissionRun mission(*scenario, recorder, std::move(outputs));
    seeds.emplace_back();
    mission.on_checkpoint([&](double t, Checkpoint checkpoint) {
      Archive more;
      RangeRecorder::Counts counts = recorder.counts();
      more.block(kRecorderCounts)(counts);
      checkpoint.merge(Checkpoint(more.checkpoint()));
      seeds.back().push_back(checkpoint_text(checkpoint));
      recorder.checkpoint(t, seeds.back().back());
    });
    mission.run(2.0, [](double) {});
    recorder.close("passed");
    ASSERT_EQ(mission.kept_elsewhere(), std::vector<std::string>{});
    ASSERT_EQ(seeds.back().size(), 8u);
    all.insert(all.end(), seeds.back().begin(), seeds.back().end());
    results.push_back(fuzz::content(h5));
    read_run_to_resume(h5, {});
    resume(options_of(folder, method), checkpoint_of(seeds.back()[3]));
  }
  fuzz::run("checkpoint", [&](Random& random, const Keep& keep) {
    const std::size_t method = random.below(kMethods.size()), what = random.below(8);
    const std::string& seed = random.of(seeds[method]);
    if (what == 0) {
      fuzz::write(h5, results[method]);
      fuzz::mutate_hdf5(h5, random);
      keep(fuzz::content(h5));
      RecordedRun run = read_run_to_resume(h5, {});
      answered([&] { resume(run.options, run.resume->checkpoint); });
      return;
    }
    std::string text = seed;
    if (what < 4) {
      text = fuzz::mutated(seed, all, kWords, random);
    } else {
      Checkpoint checkpoint = checkpoint_of(seed);
      for (std::size_t n = 1 + random.below(3); n > 0; --n) change(checkpoint, checkpoint_of(random.of(all)), random);
      keep(seed);
      text = checkpoint_text(checkpoint);  // a text that is no UTF-8 is none of JSON
    }
    keep(text);
    answered([&] { resume(options_of(folder, kMethods[method]), checkpoint_of(text)); });
  });
}

}  // namespace
}  // namespace cardan
