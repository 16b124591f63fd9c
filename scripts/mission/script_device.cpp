#include "scripts/mission/script_device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <set>
#include <utility>

#include "core/abi/cardan_field.h"
#include "core/abi/device_laws.hpp"
#include "core/base/units.hpp"
#include "core/model/schema.hpp"

namespace cardan {
namespace {

std::array<ScriptDevice*, ScriptDevice::kMost> slots{};
std::mutex access;

void set_numbers(lua_State* L, const char* name, const double* x, int n) {
  lua_createtable(L, n, 0);
  for (int i = 0; i < n; ++i) lua_pushnumber(L, x[i]), lua_rawseti(L, -2, i + 1);
  lua_setfield(L, -2, name);
}
void set_number(lua_State* L, const std::string& name, double x) {
  lua_pushnumber(L, x);
  lua_setfield(L, -2, name.c_str());
}

/// Three numbers of the field `name` of the table at the top; zeros where it is absent.
void three(lua_State* L, const char* name, double* out, const Located& at) {
  lua_getfield(L, -1, name);
  if (!lua_isnil(L, -1)) {
    if (!lua_istable(L, -1)) refuse(Code::lua_runtime, at, fmt::format("{} = {{x, y, z}}", name), describe_value(L, -1));
    for (int i = 0; i < 3; ++i) {
      lua_rawgeti(L, -1, i + 1);
      if (lua_type(L, -1) != LUA_TNUMBER) refuse(Code::lua_runtime, at, fmt::format("{} = {{x, y, z}}", name), describe_value(L, -1));
      out[i] = lua_tonumber(L, -1);
      lua_pop(L, 1);
    }
  }
  lua_pop(L, 1);
}

const std::vector<std::string> kOfLoad{"force", "moment"};

/// Marks that a device without `evaluate` holds as its outputs, then what it remembers.
std::size_t held_outputs(const ScriptDevice::Description& d) { return d.in_step ? 0 : d.outputs.size(); }

}  // namespace

template <std::size_t kSlot>
struct ScriptDevice::Functions {
  static int pack(const cardan_param_values* values, void* packed) { return slots[kSlot]->pack(values, packed); }
  static int evaluate(const cardan_device_args* a, cardan_device_out* out) { return slots[kSlot]->evaluate(a, out); }
  static int tick(const cardan_device_args* a, double period, const double*, double*, double* d) {
    return slots[kSlot]->tick(a, period, d);
  }
};

template <std::size_t... kSlots>
void ScriptDevice::take_slot(std::index_sequence<kSlots...>) {
  const std::lock_guard lock(access);
  const auto take = [&]<std::size_t kSlot>() {
    if (slot_ < kMost || slots[kSlot]) return;
    slots[slot_ = kSlot] = this;
    if (!d_.params.empty()) family_.pack = Functions<kSlot>::pack;
    family_.evaluate = Functions<kSlot>::evaluate;
    if (d_.tick) family_.tick = Functions<kSlot>::tick;
  };
  (take.template operator()<kSlots>(), ...);
}

ScriptDevice::ScriptDevice(LuaHost& lua, bool& running, Description description, Located at)
    : lua_(lua), running_(running), d_(std::move(description)), at_(std::move(at)) {
  for (const Item& p : d_.params)
    params_.push_back({p.name.c_str(),
                       CARDAN_NUMBER,
                       p.given ? 0u : static_cast<unsigned>(CARDAN_REQUIRED),
                       p.unit.c_str(),
                       "of the script",
                       {p.value},
                       0.0,
                       0.0,
                       0,
                       nullptr,
                       nullptr});
  const auto use = [&](const Mount& m) -> std::uint32_t {
    const std::uint32_t load = m.reads ? 0u : static_cast<std::uint32_t>(CARDAN_USE_LOAD);
    if (m.hinge) return d_.in_step ? load : 0u;
    return CARDAN_USE_POSE | CARDAN_USE_VELOCITY | (d_.in_step ? load : static_cast<std::uint32_t>(CARDAN_USE_ACCELERATION));
  };
  static_assert(std::size(kQuantities) == CARDAN_TIME + 1);
  for (const Mount& m : d_.mounts)
    if (m.quantity >= 0)
      mounts_.push_back({m.name.c_str(), CARDAN_MOUNT_FIELD,
                         static_cast<std::uint32_t>(m.quantity) | (m.optional ? std::uint32_t{CARDAN_USE_OPTIONAL} : 0u), "a field"});
    else
      mounts_.push_back({m.name.c_str(), static_cast<std::uint32_t>(m.hinge ? CARDAN_MOUNT_HINGE : CARDAN_MOUNT_NODE), use(m),
                         m.hinge ? "a component of a hinge" : "a node"});
  for (const Item& i : d_.inputs)
    ports_.push_back({i.name.c_str(), CARDAN_PORT_IN, i.unit.c_str(), i.value, 0, "of the script", nullptr, 0, nullptr});
  const std::uint64_t direct = d_.in_step ? ~std::uint64_t{0} : 0;
  for (const Item& o : d_.outputs)
    ports_.push_back({o.name.c_str(), CARDAN_PORT_OUT, o.unit.c_str(), 0.0, direct, "of the script", nullptr, 0, nullptr});
  for (const Item& z : d_.states) states_.push_back({z.name.c_str(), z.unit.c_str(), z.value, 1.0, "of the script"});
  for (std::size_t i = 0; i < held_outputs(d_); ++i)
    marks_.push_back({d_.outputs[i].name.c_str(), d_.outputs[i].unit.c_str(), d_.outputs[i].value, 1.0, "held since the last tick"});
  for (const Item& m : d_.memory) marks_.push_back({m.name.c_str(), m.unit.c_str(), m.value, 1.0, "of the script"});
  const auto names = [](std::vector<std::string>& to, const auto& items) {
    for (const auto& item : items) to.push_back(item.name);
  };
  names(of_evaluate_, d_.outputs), names(of_evaluate_, d_.states);
  for (const Mount& m : d_.mounts)
    if (m.quantity < 0 && !m.reads) of_evaluate_.push_back(m.name);
  if (!d_.in_step) names(of_tick_, d_.outputs);
  names(of_tick_, d_.memory);
  cardan_device_family& f = family_;
  f.struct_size = sizeof f;
  f.type = d_.type.c_str(), f.summary = d_.summary.c_str();
  f.params_size = static_cast<std::uint32_t>(d_.params.size() * sizeof(double));
  const auto list = [](auto& to, std::uint32_t& n, std::uint32_t& size, const auto& from) {
    to = from.empty() ? nullptr : from.data(), n = static_cast<std::uint32_t>(from.size()), size = sizeof(from[0]);
  };
  list(f.params, f.n_params, f.param_size, params_), list(f.mounts, f.n_mounts, f.mount_size, mounts_);
  list(f.ports, f.n_ports, f.port_size, ports_), list(f.states, f.n_states, f.state_size, states_);
  list(f.marks, f.n_marks, f.mark_size, marks_);
  take_slot(std::make_index_sequence<kMost>());
  if (slot_ == kMost)
    refuse(Code::lua_argument, at_, fmt::format("at most {} types of devices from scripts", kMost), "one more",
           "a plugin has no such limit");
}

ScriptDevice::~ScriptDevice() {
  const std::lock_guard lock(access);
  if (slot_ < kMost) slots[slot_] = nullptr;
}

int ScriptDevice::pack(const cardan_param_values* values, void* packed) const {
  for (std::size_t i = 0; i < d_.params.size(); ++i)
    static_cast<double*>(packed)[i] = *values->numbers(values, d_.params[i].name.c_str(), nullptr);
  return 0;
}

/// One table with everything by its name.
void ScriptDevice::push_arguments(lua_State* L, const cardan_device_args* a, bool ticking) const {
  lua_createtable(L, 0, 16);
  set_number(L, "t", a->t);
  const auto all = [&](const std::vector<Item>& items, const double* x) {
    for (std::size_t i = 0; i < items.size(); ++i) set_number(L, items[i].name, x[i]);
  };
  all(d_.params, static_cast<const double*>(a->packed));
  all(d_.inputs, a->in), all(d_.states, a->z);
  if (held_outputs(d_) > 0) all(d_.outputs, a->d);
  all(d_.memory, a->d + held_outputs(d_));
  for (std::size_t i = 0; i < d_.mounts.size(); ++i) {
    const cardan_mount_motion& m = a->mount[i];
    if (d_.mounts[i].quantity >= 0) {
      const int n = kQuantities[d_.mounts[i].quantity].numbers;
      if (n == 1)
        set_number(L, d_.mounts[i].name, m.field[0]);
      else
        set_numbers(L, d_.mounts[i].name.c_str(), m.field, n);
      continue;
    }
    lua_createtable(L, 0, 6);
    if (d_.mounts[i].hinge) {
      set_number(L, "q", m.q), set_number(L, "v", m.v);
    } else {
      set_numbers(L, "R", m.R_WN, 9), set_numbers(L, "position", m.position, 3);
      set_numbers(L, "rate", m.omega, 3), set_numbers(L, "velocity", m.velocity, 3);
      if (ticking) set_numbers(L, "specific_force", m.specific_force, 3), set_numbers(L, "alpha", m.alpha, 3);
    }
    lua_setfield(L, -2, d_.mounts[i].name.c_str());
  }
}

/// Of the table at the top.
std::optional<double> ScriptDevice::number(lua_State* L, const std::string& name, bool required) const {
  lua_getfield(L, -1, name.c_str());
  const int type = lua_type(L, -1);
  const double x = lua_tonumber(L, -1);
  if (type != LUA_TNUMBER && (required || type != LUA_TNIL))
    refuse(Code::lua_runtime, at_, fmt::format("a table with {} = a number", name), describe_value(L, -1));
  if (tried_ && type == LUA_TNUMBER && !std::isfinite(x))  // at the points of the laws it may be outside of its domain
    refuse(Code::lua_runtime, at_, fmt::format("a finite number for {}", name), describe_value(L, -1));
  lua_pop(L, 1);
  return type == LUA_TNUMBER ? std::optional(x) : std::nullopt;
}

/// The table at the top has nothing else.
void ScriptDevice::expect_names(lua_State* L, const std::vector<std::string>& names) const {
  for (lua_pushnil(L); lua_next(L, -2); lua_pop(L, 1)) {
    const std::string name = lua_type(L, -2) == LUA_TSTRING ? lua_tostring(L, -2) : describe_value(L, -2);
    if (std::ranges::find(names, name) == names.end())
      refuse(Code::lua_runtime, at_, names.empty() ? "an empty table" : "numbers of " + one_of(names), in_quotes(name),
             did_you_mean(name, names));
  }
}

template <class Read>
int ScriptDevice::call(const LuaFunction& function, const cardan_device_args* a, double period, bool ticking, const Read& read) {
  const bool inside = std::exchange(running_, true);
  int code = 0;
  try {
    lua_.protect(
        [&](lua_State* L) {
          luaL_checkstack(L, LUA_MINSTACK, nullptr);
          function.push(L);
          push_arguments(L, a, ticking);
          if (ticking) lua_pushnumber(L, period);
          lua_call(L, ticking ? 2 : 1, 1);
          if (!lua_istable(L, -1)) refuse(Code::lua_runtime, at_, "a table of numbers by their names", describe_value(L, -1));
          read(L);
        },
        lua_.call_budget());
    failure_.reset();
  } catch (const InputError& e) {
    failure_ = e.diagnostics().front();
    if (failure_->at.key_path == at_.key_path) failure_->at.key_path = fmt::format("device {}.{}", d_.type, ticking ? "tick" : "evaluate");
    code = 1;
  }
  running_ = inside;
  return code;
}

int ScriptDevice::evaluate(const cardan_device_args* a, cardan_device_out* out) {
  if (!d_.in_step) {
    for (std::size_t i = 0; i < d_.outputs.size(); ++i) out->out[i] = a->d[i];
    return 0;
  }
  const auto start = std::chrono::steady_clock::now();
  const int code = call(d_.evaluate, a, 0.0, false, [&](lua_State* L) {
    for (std::size_t i = 0; i < d_.outputs.size(); ++i) out->out[i] = *number(L, d_.outputs[i].name, true);
    for (std::size_t i = 0; i < d_.states.size(); ++i) out->zdot[i] = *number(L, d_.states[i].name, true);
    for (std::size_t i = 0; i < d_.mounts.size(); ++i) {
      const Mount& m = d_.mounts[i];
      if (m.quantity >= 0 || m.reads) continue;
      if (m.hinge) {
        out->load[i].tau = number(L, m.name, false).value_or(0.0);
        continue;
      }
      lua_getfield(L, -1, m.name.c_str());
      if (!lua_isnil(L, -1)) {
        if (!lua_istable(L, -1))
          refuse(Code::lua_runtime, at_, fmt::format("{} = {{force = {{x, y, z}}, moment = {{x, y, z}}}}", m.name), describe_value(L, -1));
        three(L, "force", out->load[i].force, at_), three(L, "moment", out->load[i].moment, at_);
        expect_names(L, kOfLoad);
      }
      lua_pop(L, 1);
    }
    expect_names(L, of_evaluate_);
  });
  ++calls_;
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return code;
}

int ScriptDevice::tick(const cardan_device_args* a, double period, double* d) {
  return call(d_.tick, a, period, true, [&](lua_State* L) {
    const std::size_t held = held_outputs(d_);
    for (std::size_t i = 0; i < held; ++i) d[i] = *number(L, d_.outputs[i].name, true);
    for (std::size_t i = 0; i < d_.memory.size(); ++i)
      if (const auto x = number(L, d_.memory[i].name, false)) d[held + i] = *x;
    expect_names(L, of_tick_);
  });
}

namespace {

/// "m.n = 0 (number)" of all that is in the table at the top, and in the tables in it, each once.
void add_contents(lua_State* L, const std::string& path, std::set<const void*>& seen, std::vector<std::string>& all) {
  if (!seen.insert(lua_topointer(L, -1)).second) return;
  luaL_checkstack(L, LUA_MINSTACK, nullptr);
  for (lua_pushnil(L); lua_next(L, -2); lua_pop(L, 1)) {
    const int type = lua_type(L, -2);
    if (type != LUA_TSTRING && type != LUA_TNUMBER) continue;
    lua_pushvalue(L, -2);  // lua_tolstring changes a number where it stands
    const std::string name = fmt::format(R"({}.{})", path, lua_tostring(L, -1));
    lua_pop(L, 1);
    if (lua_istable(L, -1))
      add_contents(L, name, seen, all);
    else
      all.push_back(fmt::format("{} = {}", name, lua_isfunction(L, -1) ? fmt::format("{}", lua_topointer(L, -1)) : describe_value(L, -1)));
  }
}

}  // namespace

/// "count = 3": its variables by name, of tables what is in them.
std::vector<std::string> ScriptDevice::variables(lua_State* L, const LuaFunction& function) const {
  std::vector<std::string> all;
  function.push(L);
  for (int i = 1;; ++i) {
    const char* name = lua_getupvalue(L, -1, i);
    if (!name) break;
    all.push_back(fmt::format("{} = {}", name,
                              lua_type(L, -1) == LUA_TTABLE || lua_type(L, -1) == LUA_TFUNCTION ? fmt::format("{}", lua_topointer(L, -1))
                                                                                                : describe_value(L, -1)));
    if (std::set<const void*> seen; lua_type(L, -1) == LUA_TTABLE && std::string_view(name) != "_ENV") add_contents(L, name, seen, all);
    lua_pop(L, 1);
  }
  lua_pop(L, 1);
  return all;
}

void ScriptDevice::expect_pure() {
  struct : LuaHost::Tape {
    int call(lua_State* L, lua_CFunction function) override { return LuaHost::guarded(L, function); }
    bool is_played() const override { return true; }
  } numbers_are_made_up;  // what is printed of them is nobody's
  const LuaHost::Taping quiet(lua_, &numbers_are_made_up);
  const auto look = [&] {
    std::vector<std::string> all;
    lua_.protect([&](lua_State* L) {
      for (const LuaFunction* f : {&d_.evaluate, &d_.tick})
        if (*f)
          for (std::string& v : variables(L, *f)) all.push_back(std::move(v));
    });
    return all;
  };
  constexpr int kSamples = 3;
  const std::vector<std::string> before = look();
  const std::vector<std::string> violations = device_law_violations(family_, kSamples);
  if (failure_) throw InputError({*failure_});
  const std::vector<std::string> after = look();
  for (std::size_t i = 0; i < before.size() && i < after.size(); ++i)
    if (before[i] != after[i])
      refuse(Code::lua_argument, at_, "functions that give the same for the same arguments and keep nothing",
             fmt::format("a variable that changes in a call: {}, then {}", before[i], after[i]),
             "numbers that a tick sets are declared: memory = {...}; rates of continuous ones: states = {...}");
  if (!violations.empty() || before.size() != after.size()) {
    const std::string broken = violations.empty() ? "variables that come and go" : violations.front();
    const bool varies = violations.empty() || broken.find("function of its arguments") != std::string::npos;
    Located at = at_;
    for (const auto& [name, function] : {std::pair{"evaluate", &d_.evaluate}, {"tick", &d_.tick}})
      if (broken.starts_with(name) && *function)
        lua_.protect([&, name = name, function = function](lua_State* L) {
          function->push(L);
          at = {fmt::format("device {}.{}", d_.type, name), lua_.definition(L, -1)};
        });
    refuse(Code::lua_argument, std::move(at), "a device that obeys the laws of its kind", broken,
           varies ? "the same arguments give the same numbers: no memory, no random numbers, no clock"
           : broken.find("finite") == std::string::npos
               ? "it is tried with numbers of order one"
               : "it is tried with numbers of order one, wherever the vehicle will be: bound what is divided by, or taken a root or a "
                 "power of, as in (L / math.max(L - q, 1e-6 * L))^n");
  }
  calls_ = 0, seconds_ = 0.0;
  tried_ = true;
}

}  // namespace cardan
