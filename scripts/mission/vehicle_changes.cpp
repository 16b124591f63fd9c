#include "scripts/mission/vehicle_changes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "bodies/vehicle/load_vehicle.hpp"
#include "core/base/activity.hpp"
#include "core/model/doubts.hpp"
#include "core/model/model_map.hpp"
#include "core/sim/diagonalised_form.hpp"
#include "core/sim/rejoin.hpp"

namespace cardan {
namespace {

/// `key` is `of` or inside of it.
bool is_in(std::string_view key, std::string_view of) {
  return key.starts_with(of) && (key.size() == of.size() || key[of.size()] == '.' || key[of.size()] == '[');
}

/// Initial values as they are given.
bool begin_alike(const SystemSpec& a, const SystemSpec& b) {
  return std::ranges::equal(a.bodies, b.bodies, [](const BodySpec& x, const BodySpec& y) {
    return x.hinge.q == y.hinge.q && x.hinge.v == y.hinge.v && x.eta == y.eta && x.etadot == y.etadot;
  });
}

void put(Overrides& values, const std::string& key, const std::string& value) {
  std::erase_if(values, [&](const auto& before) { return is_in(before.first, key); });
  values.emplace_back(key, value);
}

}  // namespace

void VehicleChanges::begin(Overrides given, std::shared_ptr<const SystemSpec> described) {
  values_ = std::move(given), described_ = std::move(described);
}

void VehicleChanges::want(Wish wish) {
  add(wishes_, std::move(wish));
  schedule();
}

void VehicleChanges::add(std::vector<Wish>& wishes, Wish wish) const {
  wish.actor = s_.actor;
  for (const Wish& other : wishes) {
    if (!is_in(wish.key, other.key) && !is_in(other.key, wish.key)) continue;
    if (wish.key == other.key && wish.value == other.value) return;
    const auto name = [](const Wish& w) { return w.told.empty() ? w.key + " = " + w.value : w.told; };
    Diagnostic d;
    d.code = Code::other_vehicle, d.at = {wish.key, wish.by}, d.stack = wish.stack;
    d.expected = "one change of it in an instant", d.got = fmt::format("{}, after {}", name(wish), name(other));
    d.hint = "the order of what happens in one instant tells nothing";
    throw InputError(std::vector{d});
  }
  wishes.push_back(std::move(wish));
  std::ranges::sort(wishes, {}, &Wish::key);
}

void VehicleChanges::schedule() {
  std::vector<std::string> told;
  for (const Wish& w : wishes_)
    if (!w.told.empty()) told.push_back(w.told);
  s_.sim->adopt([this] { return make(); }, told.empty() ? "model" : fmt::format("{}", fmt::join(told, ", ")));
}

void VehicleChanges::want(const std::vector<Wish>& values) {
  const Activity activity("a changed vehicle");
  Overrides tried = with_wishes();
  for (const Wish& wish : values) put(tried, wish.key, wish.value);
  try {
    SystemSpec spec = described(tried);
    if (wishes_.empty() && !rejoined_ && !joined_otherwise(*s_.model->spec, spec)) carried_model(std::move(spec));
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all)
      if (d.at.mark.file.empty() || d.at.mark.file.starts_with("--set")) d.at.mark = values.front().by, d.stack = values.front().stack;
    throw InputError(all);
  }
  std::vector<Wish> all = wishes_;  // all of them, or none
  for (const Wish& wish : values) add(all, wish);
  wishes_ = std::move(all);
  schedule();
}

Overrides VehicleChanges::with_wishes() const {
  Overrides all = values_;
  for (const Wish& wish : wishes_) put(all, wish.key, wish.value);
  return all;
}

/// The text with these values; modes whose source is as it was are not made anew.
SystemSpec VehicleChanges::described(const Overrides& values) const {
  SystemSpec spec = vehicle_from_text(described_->source_text, s_.file, s_.registry, values, described_.get());
  take_modes(spec, *s_.model->spec);
  make_modes(spec, ModeCache::of_user());
  for (std::size_t i = 0; i < std::min(spec.bodies.size(), described_->bodies.size()); ++i) {
    BodySpec& body = spec.bodies[i];
    const BodySpec& begun = described_->bodies[i];
    if (body.name != begun.name || body.hinge.type != begun.hinge.type) continue;
    // A hinge that is written anew, as vehicle:attach does, begins where it began.
    const bool anew = body.hinge.q.empty() && body.hinge.v.empty() &&
                      std::ranges::find(values, "bodies." + body.name + ".hinge", &Overrides::value_type::first) != values.end();
    if (begun_elsewhere_ || anew) body.hinge.q = begun.hinge.q, body.hinge.v = begun.hinge.v;
    if (begun_elsewhere_) body.eta = begun.eta, body.etadot = begun.etadot;
  }
  return spec;
}

std::shared_ptr<const Model> VehicleChanges::carried_model(SystemSpec spec) const {
  // Where the assembler has found the start it finds another one with other masses: what was given is compared then.
  const bool found = !s_.model->loops.moved.empty(), alike = found && begin_alike(described(values_), spec);
  const auto model = compile(std::make_shared<const SystemSpec>(std::move(spec)), s_.registry, s_.options());
  const State after = model->initial_state(), kept = carried(s_.model->initial_state(), model_map(*s_.model, *model), *model);
  const bool moved = found ? !alike : kept.q != after.q || kept.v != after.v;
  if (moved || kept.z != after.z || kept.marks != after.marks)
    refuse(Code::other_vehicle, {"vehicle:change"}, "values that hold from now on", "an initial state", "a run begins once");
  return model;
}

/// At the end of the instant. What is refused is told of who asked for it.
Rejoined VehicleChanges::make() {
  const std::vector<Wish> wishes = std::exchange(wishes_, {});
  Overrides values = values_;
  for (const Wish& wish : wishes) put(values, wish.key, wish.value);
  actor_ = wishes.front().actor;
  try {
    Rejoined next = made(values);
    if (const SimulationOptions& run = s_.sim->options(); is_diagonalised(run.dynamics))
      DiagonalisedForm::expect_honoured(*next.model, run.dynamics, run.integrator, {"mission.dynamics"});
    values_ = std::move(values);
    instants_.push_back({values_, initial_places(*next.model->spec)});
    return next;
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all) {
      const auto about =
          std::ranges::find_if(wishes, [&](const Wish& w) { return is_in(d.at.key_path, w.key) || is_in(w.key, d.at.key_path); });
      const Wish& by = about == wishes.end() ? wishes.front() : *about;
      actor_ = by.actor;
      d.at.mark = by.by, d.stack = by.stack;
      if (d.code == Code::open_start) {
        d.about = "the ends of a loop do not meet", d.expected = "a loop whose ends meet where they are";
        d.got += fmt::format(" at t = {:.6g} s", s_.sim->state().t),
            d.hint = "with as_found: true a weld holds its ends, and a coupling its sum, as they are";
      }
    }
    throw InputError(all);
  }
}

Rejoined VehicleChanges::made(const Overrides& values) {
  SystemSpec spec = described(values);
  if (!rejoined_ && !joined_otherwise(*s_.model->spec, spec)) {
    const auto model = carried_model(std::move(spec));
    return {model, carried(s_.sim->state(), model_map(*s_.model, *model), *model)};
  }
  rejoined_ = true;
  return rejoin(*s_.sim, std::move(spec), s_.registry, s_.options());
}

Warnings VehicleChanges::without_effect() const {
  if (!described_) return {};
  const auto ever = [this](const std::string& path, const std::string& value) {
    const auto is = [&](const auto& change) { return change.first == path && change.second == value; };
    return std::ranges::any_of(instants_, [&](const Instant& i) { return std::ranges::any_of(i.values, is); });
  };
  std::vector<std::string> unlocked;
  for (const BodySpec& body : described_->bodies)
    if (ever("bodies." + body.name + ".hinge.locked", "false")) unlocked.push_back(body.name);
  Warnings found = held_back(*described_, unlocked);
  for (const BodySpec& body : described_->bodies)
    if (!body.hinge.locked) unlocked.push_back(body.name);
  found.add(idle_at_hinges(*s_.model, unlocked));
  for (const LoopSpec& loop : described_->loops)
    if (loop.open && !ever("loops." + loop.name + ".open", "false"))
      found.add(Code::no_effect, described_->locate("loops." + loop.name), "open all the time: nothing closed it",
                fmt::format("sat:close(\"{}\")", loop.name));
  return found;
}

void VehicleChanges::remember(Archive& a) {
  std::vector<Instant> instants = instants_;
  a.block("vehicle")(instants, wishes_, rejoined_);
  if (!a.reading()) return;
  for (std::size_t i = instants_.size(); i < instants.size(); ++i) {  // those before the run the script has made again
    const Instant& instant = instants[i];
    SystemSpec spec = described(instant.values);
    // Without hinges that became others its initial values are the described ones, rates too, and go on being compared with.
    if (rejoined_ && !put_initial_places(spec, instant.places)) a.wrong("coordinates of another vehicle");
    s_.sim->adopt_again(compile(std::make_shared<const SystemSpec>(std::move(spec)), s_.registry, s_.options()));
    values_ = instant.values;
  }
  instants_ = std::move(instants);
}

}  // namespace cardan
