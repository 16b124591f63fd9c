// What must hold all along a run of a vehicle with devices of every kind.
#include "tests/properties/equipped_vehicle.hpp"

#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/sim/simulation.hpp"
#include "tests/support/random_tree.hpp"

namespace cardan::test {
namespace {

/// A sum with its terms in another order.
std::string shuffled(const std::string& sum, std::mt19937& random) {
  std::vector<std::string> terms;
  for (std::size_t at = 0; at < sum.size();) {
    const std::size_t end = std::min(sum.find(" + ", at), sum.size());
    terms.push_back(sum.substr(at, end - at));
    at = end + 3;
  }
  std::ranges::shuffle(terms, random);
  return fmt::format("{}", fmt::join(terms, " + "));
}

/// All numbers at the end of a run, those of devices by their names.
std::map<std::string, double> end_of(const SystemSpec& spec, const std::string& method) {
  SimulationOptions options;
  options.seed = 11;
  options.integrator.method = method;
  Simulation sim(equipped(spec), options);
  const Model& m = sim.model();
  const int voltage = m.devices.all[static_cast<std::size_t>(m.devices.find("motor"))].in;
  sim.every({1, 4}, [&sim, voltage] { sim.set_device_input(voltage, 2.0 * std::cos(3.0 * sim.time())); });
  sim.run(1.5);
  std::map<std::string, double> all = {{"steps", sim.statistics().steps}, {"energy", sim.ledger().energy}};
  const State& s = sim.state();
  for (int i = 0; i < m.nq; ++i) all[fmt::format("q {}", i)] = s.q[i];
  for (int i = 0; i < m.nv; ++i) all[fmt::format("v {}", i)] = s.v[i];
  for (const Device& d : m.devices.all) {
    for (std::uint32_t i = 0; i < d.family->n_states; ++i)
      all[fmt::format("state {}.{}", d.name, d.family->states[i].name)] = s.z[d.z + static_cast<int>(i)];
    for (std::uint32_t i = 0; i < d.family->n_marks; ++i)
      all[fmt::format("mark {}.{}", d.name, d.family->marks[i].name)] = s.marks[d.mark + static_cast<int>(i)];
    for (int i = 0; i < d.n_out; ++i) all[fmt::format("output {} {}", d.name, i)] = sim.device_output(d.out + i);
  }
  return all;
}

/// Ticks, noise, delays, pulses, a tank that empties into three thrusters, sums of three: in whatever order it is described.
TEST(EquippedVehicle, RunsToTheSameBitsWhateverTheOrderOfItsDevicesAndConnections) {
  for (const std::string method : {"dopri5", "cvode_bdf"}) {
    const auto as_written = end_of(equipped_vehicle(), method);
    EXPECT_EQ(as_written.at("mark imu.samples"), 150.0);
    for (unsigned seed = first_seed(); seed < first_seed() + 10; ++seed) {
      SystemSpec spec = equipped_vehicle();
      std::mt19937 random(seed);
      std::ranges::shuffle(spec.devices, random);
      std::ranges::shuffle(spec.fields, random);
      for (DeviceSpec& d : spec.devices)
        for (auto& [name, input] : d.inputs)
          if (auto* sum = std::get_if<std::string>(&input.value)) *sum = shuffled(*sum, random);
      const auto again = end_of(spec, method);
      ASSERT_EQ(again.size(), as_written.size());
      for (const auto& [name, x] : as_written) EXPECT_EQ(again.at(name), x) << name << ", " << method << ", order no. " << seed;
    }
  }
}

/// Errors of devices are not hidden among those of hinges and modes, however many there are.
TEST(EquippedVehicle, HasAGroupOfItsDevicesInTheErrorNorm) {
  Simulation sim(equipped(), {});
  const Model& m = sim.model();
  const std::vector<int> group = sim.ode().group;
  ASSERT_EQ(group.size(), static_cast<std::size_t>(m.nq + m.nv + m.devices.n_z));
  ASSERT_GT(m.devices.n_z, 10);
  const auto devices = group.begin() + m.nq + m.nv;
  EXPECT_EQ(std::count(devices, group.end(), *devices), m.devices.n_z);
  EXPECT_EQ(std::count(group.begin(), devices, *devices), 0);
  EXPECT_EQ(std::set<int>(group.begin(), devices).size(), 2u) << "hinges and modes";
}

}  // namespace
}  // namespace cardan::test
