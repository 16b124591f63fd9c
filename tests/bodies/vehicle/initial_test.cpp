// `initial` of a hinge: what `cardan types` prints is what vehicles and missions take.
#include "core/model/initial.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/io/yaml_reader.hpp"
#include "hinges/register.hpp"

namespace cardan {
namespace {

struct Values {
  std::vector<double> q, v;
};

/// Of a hinge that starts at zero, without rotation.
Values read_initial(const cardan_hinge_family& family, const std::string& text) {
  Values x{std::vector<double>(family.nq), std::vector<double>(family.nv)};
  const auto groups = coordinate_groups(family);
  if (!groups.empty() && groups[0].size == 4) x.q[0] = 1.0;
  const DocNode root = parse_yaml(text, "test.yaml");
  DiagnosticSink sink;
  std::vector<std::pair<std::string, std::string>> defaults;
  ReadContext context{sink, defaults};
  MapReader map({&root, "initial"}, context);
  read_initial(map, family, x.q.data(), x.v.data());
  map.finish();
  sink.throw_if_any();
  return x;
}

std::vector<const cardan_hinge_family*> families() {
  static const Registry registry = [] {
    Registry r;
    register_hinges(r);
    return r;
  }();
  std::vector<const cardan_hinge_family*> all;
  for (const auto& e : registry.hinges.all()) all.push_back(e.family);
  return all;
}

std::string list_of(std::size_t n, double x) { return fmt::format("[{}]", fmt::join(std::vector<double>(n, x), ", ")); }

TEST(InitialValues, AreGivenByTheNameOfEachComponent) {
  for (const cardan_hinge_family* f : families()) {
    std::string text;
    const bool quaternion = f->nq > f->nv;
    for (std::uint32_t i = 0; i < f->nq; ++i) text += fmt::format("{}: {}\n", f->q_names[i], quaternion && i < 4 ? 0.5 : 0.1 + i);
    for (std::uint32_t i = 0; i < f->nv; ++i) text += fmt::format("{}: {}\n", f->v_names[i], 10.1 + i);
    if (text.empty()) continue;
    const Values x = read_initial(*f, text);
    for (std::uint32_t i = 0; i < f->nq; ++i) EXPECT_EQ(x.q[i], quaternion && i < 4 ? 0.5 : 0.1 + i) << f->type << " " << f->q_names[i];
    for (std::uint32_t i = 0; i < f->nv; ++i) EXPECT_EQ(x.v[i], 10.1 + i) << f->type << " " << f->v_names[i];
  }
}

TEST(InitialValues, AreGivenByEachNameOfAGroup) {
  int seen = 0;
  for (const cardan_hinge_family* f : families()) {
    for (const ComponentGroup& g : coordinate_groups(*f))
      for (const std::string& name : g.names) {
        const Values x = read_initial(*f, fmt::format("{}: {}", name, list_of(g.size, 0.5)));
        for (std::size_t i = 0; i < f->nq; ++i)
          EXPECT_EQ(x.q[i], i >= g.first && i < g.first + g.size ? 0.5
                            : i == 0 && f->nq > f->nv            ? 1.0
                                                                 : 0.0)
              << f->type << " " << name << " " << i;
        ++seen;
      }
    for (const ComponentGroup& g : velocity_groups(*f))
      for (const std::string& name : g.names) {
        const Values x = read_initial(*f, fmt::format("{}: {}", name, list_of(g.size, 0.5)));
        for (std::size_t i = 0; i < f->nv; ++i)
          EXPECT_EQ(x.v[i], i >= g.first && i < g.first + g.size ? 0.5 : 0.0) << f->type << " " << name << " " << i;
        ++seen;
      }
  }
  EXPECT_EQ(seen, 3 * 2 + 3 + 3 * 2 + 3)
      << "attitude: ball, free, free_body; position: translational and the last two; their rates likewise";
}

Code code_of(const std::string& type, const std::string& text) {
  for (const cardan_hinge_family* f : families())
    if (f->type == type) {
      try {
        read_initial(*f, text);
      } catch (const InputError& e) {
        return e.diagnostics().front().code;
      }
    }
  throw std::runtime_error("it was accepted");
}

TEST(InitialValues, AreGivenOnce) {
  EXPECT_EQ(code_of("free", "{position: [1, 2, 3], y: 2}"), Code::wrong_type);
  EXPECT_EQ(code_of("free", "{attitude: [1, 0, 0, 0], orientation: {rotvec: [0, 0, 1]}}"), Code::wrong_type);
  EXPECT_EQ(code_of("ball", "{rate: [1, 2, 3], angular_velocity: [1, 2, 3]}"), Code::wrong_type);
  EXPECT_EQ(code_of("ball", "{attitude: [1, 0, 0, 0], qx: 0}"), Code::wrong_type);
}

TEST(InitialValues, OfAQuaternionHaveUnitLength) {
  EXPECT_EQ(code_of("ball", "{qx: 0.5}"), Code::non_unit_quaternion);
  EXPECT_EQ(code_of("free", "attitude: [1, 1, 0, 0]"), Code::non_unit_quaternion);
  EXPECT_EQ(code_of("planar", "{z: 1}"), Code::unknown_key);
}

}  // namespace
}  // namespace cardan
