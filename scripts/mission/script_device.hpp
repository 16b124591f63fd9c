#pragma once
// Types of devices whose functions a script gives, for prototypes: the same table as any other device (core/abi/cardan_device.h).
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "core/abi/cardan_device.h"
#include "scripts/lua/function.hpp"

namespace cardan {

/// One type. Its table points into it: it lives as long as the scenario, and stays where it is.
class ScriptDevice {
 public:
  /// A name with its unit, of SI; of parameters, states and inputs with a value.
  struct Item {
    std::string name, unit = "1";
    double value = 0.0;
    bool given = false;  // the value is
  };
  /// Where it is: a node, a component of a hinge; or what it reads at the node before it in the list: one of kQuantities.
  struct Mount {
    std::string name;
    bool hinge = false;
    bool reads = false;     // without pushing there; so a prescribed component will do
    int quantity = -1;      // a field
    bool optional = false;  // of a field: the vehicle may have none, all its numbers are then 0
  };
  /// Fields in the order of cardan_quantity: their names, how many numbers a script gets, whether they are of time alone.
  struct Quantity {
    const char* name;
    int numbers;
    bool of_time;
  };
  static constexpr Quantity kQuantities[] = {{"gravity", 3, false}, {"magnetic", 3, false}, {"density", 1, false}, {"wind", 3, false},
                                             {"light", 3, false},   {"position", 3, true},  {"attitude", 4, true}, {"time", 1, true}};
  struct Description {
    std::string type, summary;
    std::vector<Item> params, inputs, outputs, states, memory;  // states: z, with in_step alone; memory: numbers that tick sets
    std::vector<Mount> mounts;
    LuaFunction evaluate, tick;
    bool in_step = false;
  };

  /// `running` is true while one of its functions runs.
  ScriptDevice(LuaHost& lua, bool& running, Description description, Located at);
  ~ScriptDevice();
  ScriptDevice(const ScriptDevice&) = delete;
  ScriptDevice& operator=(const ScriptDevice&) = delete;

  const cardan_device_family& family() const { return family_; }
  const Description& description() const { return d_; }
  /// The laws of devices, and the variables of its functions before and after. Throws InputError at its place for what is not pure.
  void expect_pure();

  /// Why the last call gave nothing; empty after one that did.
  const std::optional<Diagnostic>& failure() const { return failure_; }
  /// Of `evaluate` inside of the right-hand side.
  long calls() const { return calls_; }
  double seconds() const { return seconds_; }

  static constexpr std::size_t kMost = 32;  // types of all scenarios at once: each has C functions of its own

 private:
  template <std::size_t kSlot>
  struct Functions;
  template <std::size_t... kSlots>
  void take_slot(std::index_sequence<kSlots...>);
  int pack(const cardan_param_values* values, void* packed) const;
  int evaluate(const cardan_device_args* a, cardan_device_out* out);
  int tick(const cardan_device_args* a, double period, double* d);
  template <class Read>
  int call(const LuaFunction& function, const cardan_device_args* a, double period, bool ticking, const Read& read);
  void push_arguments(lua_State* L, const cardan_device_args* a, bool ticking) const;
  std::optional<double> number(lua_State* L, const std::string& name, bool required) const;
  void expect_names(lua_State* L, const std::vector<std::string>& names) const;
  std::vector<std::string> variables(lua_State* L, const LuaFunction& function) const;

  LuaHost& lua_;
  bool& running_;
  Description d_;
  Located at_;
  std::vector<cardan_param_desc> params_;
  std::vector<cardan_mount_desc> mounts_;
  std::vector<cardan_port_desc> ports_;
  std::vector<cardan_state_desc> states_, marks_;
  cardan_device_family family_{};
  std::size_t slot_ = kMost;
  std::vector<std::string> of_evaluate_, of_tick_;  // names that they may return
  bool tried_ = false;                              // by expect_pure()
  std::optional<Diagnostic> failure_;
  long calls_ = 0;
  double seconds_ = 0.0;
};

}  // namespace cardan
