// What a report on a plugin tells of each law: that it was tried, the worst error as the law computed it, its limit, and where; or why not.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "bodies/register.hpp"
#include "core/abi/body_laws.hpp"
#include "core/abi/device_laws.hpp"
#include "core/abi/field_laws.hpp"
#include "core/abi/laws.hpp"
#include "core/abi/registry.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"

namespace cardan {
namespace {

const Registry& all_built_in() {
  static const Registry all = [] {
    Registry r;
    register_hinges(r), register_bodies(r), register_devices(r);  // fields with them
    return r;
  }();
  return all;
}

TriedLaw entry(const LawRecord& record, const std::string& law) {
  const auto found = std::ranges::find(record, law, &TriedLaw::law);
  if (found != record.end()) return *found;
  ADD_FAILURE() << law << " is not in the record";
  return {};
}

void expect_complete(const LawRecord& record, const std::string& type) {
  EXPECT_GT(record.size(), 10u) << type;
  for (const TriedLaw& t : record) {
    EXPECT_EQ(t.broken, 0u) << type << ": " << t.law;
    EXPECT_NE(t.trials == 0, t.untried.empty()) << type << ": " << t.law;
    EXPECT_TRUE(!t.measured || t.error <= t.limit) << type << ": " << t.law << ": " << t.error;
  }
}

TEST(LawRecord, TellsOfEachLawOfEveryBuiltInType) {
  LawRecord record;
  const auto silent = [](std::string_view) {};
  const auto of_all = [&](const auto& families, const auto& laws) {
    for (const auto& entry : families.all()) {
      laws(*entry.family, 24, 1, silent, &record);
      expect_complete(record, entry.family->type);
    }
  };
  of_all(all_built_in().hinges, hinge_law_violations);
  of_all(all_built_in().devices, device_law_violations);
  of_all(all_built_in().fields, field_law_violations);
  body_law_violations(*all_built_in().body("modal_flexible"), 24, 1, silent, &record);
  expect_complete(record, "modal_flexible");
}

/// The record of one law, which is broken; its worst error is what the violations tell as well.
TriedLaw broken(const LawRecord& record, const std::vector<std::string>& violations, const std::string& law) {
  const TriedLaw t = entry(record, law);
  EXPECT_GT(t.broken, 0u) << law;
  EXPECT_GT(t.error, t.limit) << law;
  const std::string told = fmt::format("error {:.2g} (limit {:.0e}, sample {}", t.error, t.limit, t.sample);  // and where that is
  EXPECT_TRUE(std::ranges::any_of(violations, [&](const std::string& v) {
    return v.starts_with(law) && v.find(told) != std::string::npos;
  })) << told;
  return t;
}

TEST(LawRecord, HasTheNumberThatTheLawComputed) {
  LawRecord record;
  const auto silent = [](std::string_view) {};
  cardan_hinge_family hinge = *all_built_in().hinge("revolute");
  hinge.axis = [](const void*, double axis[3], double*) { axis[0] = 3.0, axis[1] = axis[2] = 0.0; };
  auto violations = hinge_law_violations(hinge, 5, 1, silent, &record);
  EXPECT_EQ(broken(record, violations, "the declared shape is true: length of the axis").error, 2.0);

  cardan_device_family device{};
  device.struct_size = sizeof device, device.type = "test/giver", device.summary = "";
  device.facts = CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE;
  device.energy = [](const cardan_device_args*) { return 0.0; };
  device.evaluate = [](const cardan_device_args*, cardan_device_out* out) { return out->lost = -2.0, 0; };
  violations = device_law_violations(device, 5, 1, silent, &record);
  EXPECT_EQ(broken(record, violations, "a passive device loses").error, 2.0);
  EXPECT_EQ(entry(record, "tangent is the derivative of evaluate").untried, "it has no tangent");

  cardan_field_family field{};
  field.struct_size = sizeof field, field.type = "test/long", field.summary = "", field.quantity = CARDAN_ATTITUDE;
  field.evaluate = [](const cardan_field_args*, std::uint32_t, const double*, double* values, double*) {
    values[0] = 1.25, values[1] = values[2] = values[3] = 0.0;
    return 0;
  };
  violations = field_law_violations(field, 5, 1, silent, &record);
  EXPECT_EQ(broken(record, violations, "an attitude is a unit quaternion").error, 0.25);

  cardan_body_family body = *all_built_in().body("modal_flexible");
  static const cardan_body_family& honest = *all_built_in().body("modal_flexible");
  body.mass = [](const void* packed, const double* eta, double* rr, double* re, double* ee) {
    honest.mass(packed, eta, rr, re, ee);
    if (rr) rr[0] *= 3.0;
  };
  violations = body_law_violations(body, 5, 1, silent, &record);
  const double of_mass = broken(record, violations, "the mass is that of the modal data").error;  // 2 m / (1 + m), of 4 to 12 kg
  EXPECT_TRUE(of_mass > 1.6 && of_mass < 2.0) << of_mass;
}

TEST(LawRecord, KeepsTheWorstSample) {
  cardan_field_family field{};
  field.struct_size = sizeof field, field.type = "test/negative", field.summary = "", field.quantity = CARDAN_DENSITY;
  field.evaluate = [](const cardan_field_args*, std::uint32_t n, const double* x, double* values, double*) {
    for (std::uint32_t i = 0; i < n; ++i) values[i] = x[3 * i] > 0.0 ? -1e300 : -1.0;
    return 0;
  };
  LawRecord record;
  field_law_violations(
      field, 40, 1, [](std::string_view) {}, &record);
  const TriedLaw density = entry(record, "a density is not negative");
  EXPECT_EQ(density.error, 1e300) << "the worst, not the last";
}

}  // namespace
}  // namespace cardan
