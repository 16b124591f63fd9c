// docs/extending: the code that the pages print, compiled beside this file (CMakeLists.txt), does what they say.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/io/yaml_reader.hpp"
#include "core/model/schema.hpp"
#include "scripts/bindings/handle.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/commands/commands.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
// The pages'.
Output altitude(Simulation& sim, int node, double radius);
int body_speed(lua_State* L);
void add_mass(CommandLine& line);
struct PaintSpec {
  double absorptance = 0.0;
  double area = 0.0;
};
PaintSpec read_paint(const DocRef& value, ReadContext& context);

namespace {

/// A point of 3 kg, 10 m from the origin, at (3, 4, 0) m/s.
std::string point() {
  const std::string folder = test::scratch("point");
  std::filesystem::create_directories(folder);
  std::ofstream(folder + "/vehicle.yaml")
      << "cardan: 1\nbodies:\n  stone: {type: particle, mass: 3 kg, hinge: {type: translational, to: world, "
         "initial: {x: 10, velocity: [3, 4, 0]}}}\n";
  std::ofstream(folder + "/scenario.lua") << "vehicle 'vehicle.yaml'\nmission { duration = 1 }\n";
  return folder;
}

std::unique_ptr<Scenario> opened() {
  ScenarioOptions options;
  options.file = point();
  return open_scenario(options);
}

TEST(ExtendingPages, TheOutputChannelGivesItsNumber) {
  const auto s = opened();
  const Output out = altitude(*s->sim, s->model->find_node("stone"), 7.0);
  double x = 0.0;
  out.fill(&x);
  EXPECT_DOUBLE_EQ(x, 3.0);
  EXPECT_EQ(out.channel.path, "nodes/stone/altitude");
  SystemSpec more = *s->model->spec;  // another body in front of it, 20 m from the origin: its node has another index
  more.bodies.insert(more.bodies.begin(), more.bodies[0]);
  more.bodies[0].name = "pebble", more.bodies[0].hinge.q = {20, 0, 0};
  s->sim->adopt(compile(more, s->registry));
  out.fill(&x);
  EXPECT_DOUBLE_EQ(x, 3.0);
}

TEST(ExtendingPages, TheAccessorAnswersAndRefuses) {
  const auto s = opened();
  s->lua.protect([&](lua_State* L) {
    lua_pushcfunction(L, method<body_speed>);
    push_handle(L, Kind::body, 0, *s);
    lua_call(L, 1, 1);
    EXPECT_DOUBLE_EQ(lua_tonumber(L, -1), 5.0);
  });
  EXPECT_THROW(s->lua.protect([&](lua_State* L) {
    lua_pushcfunction(L, method<body_speed>);
    push_handle(L, Kind::hinge, 0, *s);
    lua_call(L, 1, 1);
  }),
               InputError);
}

TEST(ExtendingPages, TheCommandRuns) {
  CommandLine line({"cardan", "mass", point()});
  add_mass(line);
  const std::function<int()> action = line.read({});
  testing::internal::CaptureStdout();
  EXPECT_EQ(action(), 0);
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "3 kg\n");
}

TEST(ExtendingPages, TheKeyIsReadInItsUnitAndRefusedOutOfItsRange) {
  DiagnosticSink sink;
  std::vector<std::pair<std::string, std::string>> defaults;
  ReadContext context{sink, defaults};
  const DocNode good = parse_yaml("{absorptance: 30 %, area: 20000 cm^2}", "test.yaml"),
                bad = parse_yaml("{absorptance: 3, aera: 2}", "test.yaml");
  const PaintSpec paint = read_paint({&good, "paint"}, context);
  EXPECT_TRUE(sink.empty());
  EXPECT_DOUBLE_EQ(paint.absorptance, 0.3);
  EXPECT_DOUBLE_EQ(paint.area, 2.0);
  EXPECT_EQ(read_paint({&bad, "paint"}, context).area, 1.0);
  ASSERT_EQ(sink.all().size(), 2u) << "the misspelt key and the range";
  EXPECT_EQ(defaults.size(), 1u);
}

}  // namespace
}  // namespace cardan
