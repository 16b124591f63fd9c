// What built-in hinges tell of the slopes of their records, against differences of these records.
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "core/soa/tangent.hpp"
#include "hinges/register.hpp"

namespace cardan::test {
namespace {

constexpr int kNumbers = sizeof(cardan_hinge_out) / sizeof(double);

std::vector<double> packed_axes(const std::string& type) {  // as pack() leaves them: unit vectors one after the other, then the pitch
  if (type == "universal") return {0.6, 0.0, 0.8, 0.0, 1.0, 0.0};
  if (type == "gimbal") return {0.6, 0.0, 0.8, 0.0, 1.0, 0.0, 0.0, -0.8, 0.6};
  if (type == "planar") return {0.6, 0.0, 0.8, 0.0, 1.0, 0.0};
  return {0.6, 0.0, 0.8, 0.0};
}

TEST(HingeSlopes, AreThoseOfTheRecord) {
  Registry registry;
  register_hinges(registry);
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> any(-2.0, 2.0);
  int told = 0;
  for (const auto& entry : registry.hinges.all()) {
    const cardan_hinge_family& f = *entry.family;
    const HingeSlopes slopes = registry.slopes(f);
    if (!slopes) continue;
    ++told;
    const std::vector<double> packed = packed_axes(f.type);
    const auto nq = static_cast<int>(f.nq), nv = static_cast<int>(f.nv);
    for (int trial = 0; trial < 20; ++trial) {
      std::vector<double> q(f.nq), v(f.nv);
      for (double& x : q) x = any(rng);
      for (double& x : v) x = any(rng);
      const auto record = [&](double* to) {
        const std::uint32_t zero = 0;
        cardan_hinge_out out{};
        f.kinematics(packed.data(), 1, &zero, &zero, q.data(), v.data(), &out);
        std::memcpy(to, &out, sizeof out);
      };
      std::vector<cardan_hinge_out> in_q(f.nq);
      std::vector<double> in_v(6 * f.nv);
      slopes(packed.data(), q.data(), v.data(), in_q.data(), in_v.data());
      double want[kNumbers], work[kNumbers];
      for (int i = 0; i < nq; ++i) {
        const double at = q[static_cast<std::size_t>(i)];
        soa::derivative([&](double s, double* to) { q[static_cast<std::size_t>(i)] = at + s, record(to); }, 0.03, kNumbers, want, work);
        q[static_cast<std::size_t>(i)] = at;
        double got[kNumbers];
        std::memcpy(got, &in_q[static_cast<std::size_t>(i)], sizeof got);
        for (int k = 0; k < kNumbers; ++k) EXPECT_NEAR(got[k], want[k], 3e-12) << f.type << ", coordinate " << i << ", number " << k;
      }
      for (int i = 0; i < nv; ++i) {
        const double at = v[static_cast<std::size_t>(i)];
        soa::derivative([&](double s, double* to) { v[static_cast<std::size_t>(i)] = at + s, record(to); }, 0.1, kNumbers, want, work);
        v[static_cast<std::size_t>(i)] = at;
        for (int k = 0; k < 6; ++k)
          EXPECT_NEAR(in_v[static_cast<std::size_t>(6 * i + k)], want[48 + k], 3e-12) << f.type << ", rate " << i << ", number " << k;
      }
    }
  }
  EXPECT_EQ(told, 5);
}

}  // namespace
}  // namespace cardan::test
