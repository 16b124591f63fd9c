// Another model in the midst of a run.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/sim/loop_doubts.hpp"
#include "core/sim/newton_operators.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {
namespace {

constexpr double kSameZero = 1e-5;  // [rad, m]: less is what closing a loop moves

[[noreturn]] void refuse_model(const std::string& path, const std::string& expected, const std::string& got) {
  refuse(Code::other_vehicle, {path}, expected, got,
         "another vehicle needs a run of its own; one that is adopted may differ in numbers, and have more");
}

/// "; arm, tip stand on the world, which has no part in these sums": bodies that do from now on, or no longer.
std::string who_stands_now(const Model& before, const Model& after, const ModelMap& map) {
  std::vector<std::string> stand, move;
  for (std::size_t i = 0; i < map.body.size(); ++i) {
    const UserBody &was = before.user[i], &is = after.user[static_cast<std::size_t>(map.body[i])];
    if ((was.sweep == 0) != (is.sweep == 0)) (is.sweep == 0 ? stand : move).push_back(is.name);
  }
  std::string out;
  if (!stand.empty())
    out += fmt::format("; {} stand{} on the world, which has no part in these sums", fmt::join(stand, ", "), stand.size() > 1 ? "" : "s");
  if (!move.empty()) out += fmt::format("; {} stand{} on the world no longer", fmt::join(move, ", "), move.size() > 1 ? "" : "s");
  return out;
}

bool same_params(const Model& before, const Device& was, const Model& after, const Device& is) {
  const auto same = [](const auto& x, const auto& y) { return x.first == y.first && x.second.value == y.second.value; };
  return std::ranges::equal(before.spec->devices[static_cast<std::size_t>(was.spec)].params,
                            after.spec->devices[static_cast<std::size_t>(is.spec)].params, same);
}

/// What a device reads of a hinge is counted from the zero that it was.
bool same_zeros(const Device& was, const Eigen::VectorXd& q_was, const Device& is, const Eigen::VectorXd& q_is) {
  const auto at = [](const DeviceMount& m, const Eigen::VectorXd& q) { return m.q >= 0 ? q[m.q] : m.still ? m.still->q : 0.0; };
  for (std::size_t i = 0; i < was.mounts.size(); ++i)
    if (std::abs(at(is.mounts[i], q_is) - at(was.mounts[i], q_was)) > kSameZero) return false;
  return true;
}

/// Which line of the model before an input with a delay goes on with; -1: none.
int line_before(const Model& before, const ModelMap& map, const DelayLine& is) {
  const auto same = [&](const DelayLine& was) {
    return map.in[static_cast<std::size_t>(was.input)] == is.input && map.device[static_cast<std::size_t>(was.clock)] == is.clock &&
           was.ticks == is.ticks && was.latency == is.latency;
  };
  const auto found = std::ranges::find_if(before.devices.delays, same);
  return found == before.devices.delays.end() ? -1 : static_cast<int>(found - before.devices.delays.begin());
}

/// What the run, its outputs and whoever holds an index may refer to is still there.
void expect_all_of(const Model& before, const ModelMap& map, const Model& after) {
  for (std::size_t i = 0; i < map.body.size(); ++i) {
    const UserBody& a = before.user[i];
    if (map.body[i] < 0) refuse_model("bodies." + a.name, "a body of the model that is adopted", "there is none of this name");
    const UserBody& b = after.user[static_cast<std::size_t>(map.body[i])];
    if (a.n_modes != b.n_modes) refuse_model("bodies." + a.name + ".modes", std::to_string(a.n_modes), std::to_string(b.n_modes));
  }
  for (std::size_t i = 0; i < map.node.size(); ++i)
    if (map.node[i] < 0) refuse_model("nodes." + before.nodes[i].name, "a node of the model that is adopted", "there is none of this name");
  for (std::size_t i = 0; i < map.device.size(); ++i) {
    const Device& a = before.devices.all[i];
    if (map.device[i] < 0) refuse_model("devices." + a.name, "a device of the model that is adopted", "there is none of this name");
    const Device& b = after.devices.all[static_cast<std::size_t>(map.device[i])];
    if (a.family != b.family) refuse_model("devices." + a.name + ".type", a.family->type, b.family->type);
    const DeviceSpec &x = before.spec->devices[static_cast<std::size_t>(a.spec)],
                     &y = after.spec->devices[static_cast<std::size_t>(b.spec)];
    if (a.family->tick && (x.rate != y.rate || x.period != y.period))
      refuse_model("devices." + a.name + ".rate", "the rate that it had", "another one");
  }
  for (const DelayLine& line : after.devices.delays)
    if (line_before(before, map, line) < 0)
      for (const Device& d : after.devices.all)
        if (line.input >= d.in && line.input < d.in + d.n_in)
          refuse_model("devices." + d.name + ".inputs", "the delay or latency that they had", "another one");
  for (const Device& d : after.devices.all)
    if (d.family->tick && before.devices.find(d.name) < 0)
      refuse_model("devices." + d.name, "no further device with a sampled part", fmt::format("one of type {}", d.family->type));
}

/// States may be carried over coordinate by coordinate.
void expect_same_joints(const Model& before, const ModelMap& map, const Model& after) {
  for (std::size_t i = 0; i < map.body.size(); ++i) {
    const UserBody& a = before.user[i];
    const UserBody& b = after.user[static_cast<std::size_t>(map.body[i])];
    if (a.hinge_type != b.hinge_type || a.nv != b.nv)
      refuse_model("bodies." + a.name + ".hinge", fmt::format("{}, {} velocities", a.hinge_type, a.nv),
                   fmt::format("{}, {}", b.hinge_type, b.nv));
  }
  const auto same = [](const Loop& a, const Loop& b) { return a.name == b.name && a.type == b.type; };
  if (!std::ranges::equal(before.loops.all, after.loops.all, same)) refuse_model("loops", "the loops that it had", "others");
}

}  // namespace

void Simulation::adopt(std::shared_ptr<const Model> model) {
  const ModelMap map = model_map(*model_, *model);
  expect_all_of(*model_, map, *model);
  expect_same_joints(*model_, map, *model);
  adopt([this, model = std::move(model)] { return Rejoined{model, carried(state_, model_map(*model_, *model), *model)}; }, "model");
}

void Simulation::adopt(std::function<Rejoined()> make, std::string told) {
  if (within_.looks) refuse_inside();
  next_model_ = std::move(make), next_told_ = std::move(told);
  if (!begun_) take_in();
}

void Simulation::adopt_again(std::shared_ptr<const Model> model) {
  adopt([this, model = std::move(model)] { return Rejoined{model, carried(state_, model_map(*model_, *model), *model)}; }, "");
  ++adopted_;
}

void Simulation::take_in() {
  const bool in_run = begun_;
  if (in_run) doing_ = RestartCause::vehicle;
  keep_steps();
  history_.leave_model();
  ledger();  // up to here
  const Sums were = in_run ? sums() : Sums{};
  const std::shared_ptr<const Model> before = model_;
  const auto make = std::exchange(next_model_, nullptr);
  Rejoined next = make();
  const ModelMap map = model_map(*before, *next.model);
  expect_all_of(*before, map, *next.model);
  for (const NodeWrench& w : std::span(wrenches_).subspan(static_cast<std::size_t>(before->devices.n_loads)))
    if (!next.model->has(OpCode::node_wrenches) || (w.world_axes && !next.model->has(OpCode::world)))
      throw std::logic_error("adopt: compile the model with the CompileOptions of the one before");
  std::optional<Jump> jump;
  if (in_run) jump.emplace(*this);
  const std::vector<double> roots_were = jump ? jump->roots() : std::vector<double>();
  own_ = next.model->changes() ? std::make_shared<Model>(*next.model) : nullptr;
  model_ = own_ ? std::shared_ptr<const Model>(own_) : next.model;
  now_ = then(now_, map, *model_);
  const Eigen::VectorXd q_was = std::exchange(state_, std::move(next.state)).q;
  of_former_models_ = statistics();
  integrator_.reset(), newton_.reset();

  std::vector<double> tau(static_cast<std::size_t>(model_->nv), 0.0);
  for (std::size_t i = 0; i < tau_.size(); ++i)
    if (map.v[i] >= 0) tau[static_cast<std::size_t>(map.v[i])] = tau_[i];
  tau_ = std::move(tau);
  const std::unique_ptr<DeviceForces> devices = std::move(devices_);
  const std::vector<Prescribed> prescribed = std::move(prescribed_);
  const std::vector<PrescribedLoop> prescribed_loops = std::move(prescribed_loops_);
  const DelayLines delays = std::move(delays_);
  const CommandAges ages = std::move(ages_);
  std::vector<NodeWrench> given(wrenches_.begin() + before->devices.n_loads, wrenches_.end());
  workspace_ = Workspace(*model_);
  build();
  for (std::size_t i = 0; devices && i < devices->commands.size(); ++i)
    if (map.in[i] >= 0) devices_->commands[static_cast<std::size_t>(map.in[i])] = devices->commands[i];
  alter_ports();
  for (std::size_t i = 0; i < model_->devices.delays.size(); ++i)
    delays_.go_on(i, delays, static_cast<std::size_t>(line_before(*before, map, model_->devices.delays[i])));
  ages_ = ages.in(before->devices, map, model_->devices, state_.t);
  for (const Prescribed& p : prescribed)
    for (Prescribed& now : prescribed_)
      if (p.given && map.v[static_cast<std::size_t>(p.index)] == now.index) now.profile = p.profile, now.given = true;
  for (const PrescribedLoop& p : prescribed_loops)
    for (PrescribedLoop& now : prescribed_loops_) {
      if (p.name != now.name) continue;
      const auto length = [&p](const Model& m) {
        const Loop& loop = m.loops.all[static_cast<std::size_t>(m.loops.find(p.name))];
        return loop.closing == Closing::distance ? loop.length : loop.coupling.offset;
      };
      now = {p.name, p.profile, p.given, state_.t, length(*before) + p.more(state_.t) - length(*model_)};
    }
  for (NodeWrench& w : given) w.node = map.node[static_cast<std::size_t>(w.node)], wrenches_.push_back(w);
  world_rates_ = world_rates_ || !given.empty();
  obstacle_.forget();
  stop_rounding();
  for (const DeviceHold& h : model_->devices.holds)  // what is held takes part in a jump of rates, and what slides may slide back
    holds_.begin_anew = holds_.begin_anew || mark_of(h) == 0.0 || state_.v[h.v] != 0.0;
  changed();
  let_inside();
  if (adopted_told_) adopted_told_();
  if (!in_run) return;
  ++adopted_;

  const std::vector<double> x_was = std::move(x_);
  make_integrator_once();
  for (std::size_t i = 0; i < map.v.size(); ++i)  // stops are struck by what a rate becomes, and not by what it was
    if (map.v[i] >= 0) x_[static_cast<std::size_t>(model_->nq + map.v[i])] = x_was[static_cast<std::size_t>(before->nq) + i];
  history_.resize(static_cast<int>(x_.size()));
  start_holds();
  const auto found = std::ranges::count_if(map.device, [](int i) { return i >= 0; });
  if (devices_ && found < std::ssize(model_->devices.all)) start_devices(map.device);
  // Devices of other parameters, or at a hinge with another zero, begin with that as at the start; of others what the change has carried
  // across zero happens.
  std::vector<double> roots(static_cast<std::size_t>(model_->devices.n_roots), 0.0);
  for (std::size_t i = 0; i < map.device.size(); ++i) {
    const Device &was = before->devices.all[i], &is = model_->devices.all[static_cast<std::size_t>(map.device[i])];
    if (same_params(*before, was, *model_, is) && same_zeros(was, q_was, is, state_.q)) {
      std::copy_n(roots_were.begin() + was.root, is.family->n_roots, roots.begin() + is.root);
    } else {
      observe();
      start_device(map.device[i]);
      changed();
    }
  }
  jump->set_roots(roots);
  jump->end();
  for (std::size_t i = 0; i < map.body.size(); ++i) {
    const UserBody& u = before->user[i];
    if (u.n_modes == 0) continue;
    const auto eta = std::span(map.q).subspan(static_cast<std::size_t>(u.eta), static_cast<std::size_t>(u.n_modes));
    if (const auto anew = std::ranges::count(eta, -1); anew > 0)
      warn(Code::mission_doubt, model_->spec->locate("bodies." + u.name + ".modes"),
           fmt::format("{} of its {} modes start from rest: their mass or stiffness is another one now", anew, u.n_modes),
           "a change that leaves shapes and frequencies as they are keeps them");
  }
  const Warnings far = loops_far_from_home(*this);
  for (const Warning& w : far.all()) warn(w.what.code, w.what.at, w.what.about, w.what.hint);
  weigh_tolerances();
  const Sums are = sums();
  balances_.go_on(are.momentum, are.energy);
  if (recorder_)
    recorder_->note(Note::event, state_.t,
                    {next_told_, fmt::format("mass {:+.6g} kg, momentum {:.6g} N s, angular momentum {:.6g} N m s, energy {:+.6g} J{}",
                                             are.momentum.mass - were.momentum.mass, (are.momentum.linear - were.momentum.linear).norm(),
                                             (are.momentum.angular - were.momentum.angular).norm(),
                                             are.energy.total() - were.energy.total(), who_stands_now(*before, *model_, map))});
}

}  // namespace cardan
