// The annotated Lua that help and completion read.
#include <gtest/gtest.h>

#include "scripts/lua/reference.hpp"

namespace cardan {
namespace {

const ApiReference& example() {
  static const ApiReference api({R"(---@meta
---@class SpinOptions
---@field rate? number|string [rad/s] how fast
---@field done fun(t: number): boolean called at the end

--- What turns. Of a thing.
---@class Thing
---@field size number [m]
local Thing = {}
--- Its rate. More words.
---@param component? integer|string default 1
---@return number rate [rad/s]
function Thing:v(component) end
Thing.rate = Thing.v
---@return number x, number y [m] world axes
function Thing:place() end

---@class Wheel: Thing
local Wheel = {}
--- Makes it spin.
---@param options SpinOptions
function Wheel:spin(options) end

--- Declares.
---@class Mission
---@overload fun(options: SpinOptions)
mission = {}
function mission.time() end

--- Finds one.
---@param name string "a"
---@return Wheel wheel
function wheel(name) end
)",
                                 "--- Numbers.\nlocal vec = {}\n\nfunction vec.add(a, b) return a + b end\nreturn vec\n"});
  return api;
}

TEST(ApiReference, ReadsFunctionsWithTheirParametersAndResults) {
  const auto found = example().find("v");
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0]->signature(), "thing:v([component])");
  EXPECT_EQ(found[0]->summary(), "Its rate");
  EXPECT_EQ(example().text_of(*found[0]),
            "thing:v([component])\n"
            "  Its rate. More words.\n"
            "\n"
            "  component?  integer|string  default 1\n"
            "\n"
            "returns\n"
            "  rate  number  [rad/s]");
  EXPECT_EQ(example().find("thing:rate").size(), 1u) << "another name of the same";
  const ApiFunction& place = *example().find("place").at(0);
  ASSERT_EQ(place.results.size(), 2u);
  EXPECT_EQ(place.results[1].name + ": " + place.results[1].text, "y: [m] world axes");
  EXPECT_EQ(example().find("vec.add").at(0)->signature(), "vec.add(a, b)") << "nothing is said about it";
}

TEST(ApiReference, TellsTheKeysOfTables) {
  EXPECT_EQ(example().text_of(*example().find("spin").at(0)),
            "wheel:spin(options)\n"
            "  Makes it spin.\n"
            "\n"
            "  options  SpinOptions\n"
            "\n"
            "SpinOptions\n"
            "  rate?  number|string            [rad/s] how fast\n"
            "  done   fun(t: number): boolean  called at the end");
  EXPECT_EQ(example().find("mission").at(0)->signature(), "mission(options)") << "an object that is called";
}

TEST(ApiReference, ClassesHaveWhatTheirParentsHave) {
  const ApiClass* wheel = example().find_class("WHEEL");
  ASSERT_NE(wheel, nullptr);
  std::string names;
  for (const ApiFunction* f : example().functions_of(*wheel)) names += f->name + " ";
  EXPECT_EQ(names, "spin v rate place ");
  EXPECT_EQ(example().text_of(*wheel),
            "wheel\n\n"
            "  wheel:spin(options)      Makes it spin\n"
            "  wheel:v([component])     Its rate\n"
            "  wheel:rate([component])  Its rate\n"
            "  wheel:place()            number");
  EXPECT_EQ(example().find("wheel:v").size(), 1u);
  EXPECT_EQ(example().find_class("none"), nullptr);
}

TEST(ApiReference, HasAnOverview) {
  const std::string all = example().overview();
  for (const char* part : {"wheel(name)", "Finds one", "mission(options)", "vec", "Numbers"})
    EXPECT_NE(all.find(part), std::string::npos) << part << "\n" << all;
  EXPECT_EQ(all.find("SpinOptions"), std::string::npos);
}

}  // namespace
}  // namespace cardan
