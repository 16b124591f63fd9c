#pragma once
// What a mission makes of its vehicle on its way: values, hinges and closures that become others at the end of an instant.
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/checkpoint.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

/// What of a scenario is concerned, as it is then.
struct ChangingVehicle {
  const std::string& file;
  const Registry& registry;
  const std::shared_ptr<const Model>& model;
  const std::unique_ptr<Simulation>& sim;
  const std::string_view& actor;  // whose function runs
  std::function<CompileOptions()> options;
};

class VehicleChanges {
 public:
  explicit VehicleChanges(ChangingVehicle vehicle) : s_(std::move(vehicle)) {}

  /// The vehicle as it is described from the start.
  void begin(Overrides given, std::shared_ptr<const SystemSpec> described);
  /// ... with other initial values, which its text gives too from now on.
  void begin_at(std::shared_ptr<const SystemSpec> start) { described_ = std::move(start), begun_elsewhere_ = true; }
  const Overrides& given() const { return values_; }
  /// That vehicle; null before.
  const std::shared_ptr<const SystemSpec>& described() const { return described_; }

  /// One value of the description that is another one from the end of this instant on.
  struct Wish {
    std::string key, value;
    std::string told;  // "detach upper"; empty: a value
    SourceMark by;
    std::string stack;
    std::string actor = {};

    void remember(Archive& a) { a(key, value, told, actor); }
  };
  /// Several wishes of one instant stand beside each other, whatever their order. InputError C0403 where two contradict each other.
  void want(Wish wish);
  /// Values alone, tried at once: InputError with all that compile() refuses.
  void want(const std::vector<Wish>& values);

  /// Who asked for what could not be done.
  const std::string& actor() const { return actor_; }

  /// Loops that are described as open and that nothing has closed, a latch that did not catch; springs of hinges that nothing has unlocked.
  Warnings without_effect() const;

  /// What happened until now; reading it, the vehicle becomes that.
  void remember(Archive& archive);
  /// After that, once the simulation goes on: what was wanted in the instant of the checkpoint.
  void go_on() {
    if (!wishes_.empty()) schedule();
  }

 private:
  struct Instant {
    Overrides values;
    std::vector<double> places;
    void remember(Archive& a) { a(values, places); }
  };

  void add(std::vector<Wish>& wishes, Wish wish) const;
  void schedule();
  SystemSpec described(const Overrides& values) const;
  Overrides with_wishes() const;
  Rejoined make();
  Rejoined made(const Overrides& values);
  std::shared_ptr<const Model> carried_model(SystemSpec spec) const;

  ChangingVehicle s_;
  Overrides values_;
  std::shared_ptr<const SystemSpec> described_;
  std::vector<Wish> wishes_;
  std::vector<Instant> instants_;
  std::string actor_;
  bool begun_elsewhere_ = false;
  bool rejoined_ = false;  // initial values of the model are those of its last instant
};

}  // namespace cardan
