// One source for editor, help and completion: what scripts find is what scripts/prelude/cardan/meta.lua says, and what the documents list.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

using Names = std::set<std::string>;

/// Functions and fields of each class of meta.lua; "" has the global functions.
struct Meta {
  std::map<std::string, Names> functions, fields;
  std::map<std::string, std::string> parents;
  Names all_functions(const std::string& c) const {
    Names out = functions.contains(c) ? functions.at(c) : Names();
    if (parents.contains(c)) out.merge(all_functions(parents.at(c)));
    return out;
  }
};
Meta read_meta() {
  Meta m;
  std::ifstream in(CARDAN_SOURCE_DIR "/scripts/prelude/cardan/meta.lua");
  std::string open;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string first, second;
    words >> first >> second;
    if (first == "---@class") {
      open = second;
      if (open.ends_with(':')) {
        open.pop_back();
        words >> m.parents[open];
      }
    } else if (first == "---@field" && !second.starts_with('[')) {
      if (second.ends_with('?')) second.pop_back();
      m.fields[open].insert(second);
    } else if (first == "function") {
      std::string whole = second.substr(0, second.find('('));
      const std::size_t joint = whole.find_first_of(".:");
      std::string owner = joint == std::string::npos ? "" : whole.substr(0, joint);
      if (owner == "sim") owner = "Sim";
      m.functions[owner].insert(joint == std::string::npos ? whole : whole.substr(joint + 1));
    } else if (first.find('.') != std::string::npos && second == "=") {  // Hinge.angle = Hinge.q
      m.functions[first.substr(0, first.find('.'))].insert(first.substr(first.find('.') + 1));
    }
  }
  return m;
}

/// "one of: a, b, c" and the like in the answers to a name that does not exist.
Names names_after(const std::string& text, const std::string& before) {
  const std::size_t at = text.find(before);
  Names out;
  if (at == std::string::npos) return out;
  std::string list = text.substr(at + before.size(), text.find('\n', at) - at - before.size());
  std::replace(list.begin(), list.end(), ',', ' ');
  std::istringstream words(list);
  for (std::string word; words >> word;) out.insert(word);
  return out;
}

Finished look(const std::string& text) {
  const TemporaryFolder dir;
  std::ofstream(dir / "look.lua") << text;
  return run_program({"workbench", kSlew, "--script", "look.lua"}, dir.path());
}

TEST(ScriptReference, HasEveryMethodThatObjectsHave) {
  const Meta meta = read_meta();
  const std::map<std::string, std::string> objects = {{"Sim", "sim"},
                                                      {"Vehicle", "sat"},
                                                      {"Body", "sat:body 'bus'"},
                                                      {"Hinge", "sat:hinge 'wing_left'"},
                                                      {"Modes", "sat:modes 'wing_left'"},
                                                      {"Node", "sat:node 'bus'"},
                                                      {"Load", "sat:node('bus'):load {}"},
                                                      {"Sequence", "sequence { name = 'plan', run = function() end }"},
                                                      {"Vector", "vector {1}"},
                                                      {"Matrix", "matrix {{1}}"},
                                                      {"Operators", "sim:operators()"},
                                                      {"Operator", "sim:operators().phi"},
                                                      {"Task", "sim:operators():task { nodes = {'bus'} }"},
                                                      {"ClosedSystem", "sim:closed_system()"},
                                                      {"Passive", "sim:operators():floating_base()"},
                                                      {"Diagonalised", "sim:operators():diagonalised()"}};
  std::string script =
      "local sat = sim:vehicle()\nlocal function ask(name, x) local ok, why = pcall(function() return x.no_such_name end) print(name .. "
      "'|' .. tostring(why):gsub('\\n', '~')) end\n";
  for (const auto& [name, expression] : objects) script += "ask('" + name + "', " + expression + ")\n";
  const Finished run = look(script);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::istringstream lines(run.out);
  std::size_t seen = 0;
  for (std::string line; std::getline(lines, line); ++seen) {
    const std::string name = line.substr(0, line.find('|'));
    std::replace(line.begin(), line.end(), '~', '\n');
    Names found;
    for (const char* before : {"one of: ", "or a method: ", "one of "})
      if (found.empty()) found = names_after(line, before);
    Names known = meta.all_functions(name);
    if (name == "Operators") known.insert(meta.fields.at(name).begin(), meta.fields.at(name).end());
    EXPECT_EQ(found, known) << name << "\n" << line;
  }
  EXPECT_EQ(seen, objects.size());
}

TEST(ScriptReference, HasEveryGlobalOfTheProgram) {
  const Meta meta = read_meta();
  const Finished run =
      look("local names = {} for name in pairs(_G) do names[#names + 1] = name end print('one of: ' .. table.concat(names, ', '))");
  Names found = names_after(run.out, "one of: ");
  for (const char* of_lua : {"_G",     "_VERSION",     "assert", "coroutine", "error",    "getmetatable", "ipairs", "load",   "math",
                             "next",   "pairs",        "pcall",  "print",     "rawequal", "rawget",       "rawlen", "rawset", "require",
                             "select", "setmetatable", "string", "table",     "tonumber", "tostring",     "type",   "utf8",   "xpcall"})
    found.erase(of_lua);
  Names known = meta.functions.at("");
  known.insert({"sim", "mission", "astro", "control", "vec", "quat", "allocation", "elliptic", "cmg", "slosh", "slew", "orbit", "pointing",
                "estimation", "filter", "help"});
  EXPECT_EQ(found, known);
  for (const char* module :
       {"vec", "quat", "allocation", "elliptic", "cmg", "slosh", "slew", "orbit", "pointing", "estimation", "filter"}) {
    std::ifstream in(std::string(CARDAN_SOURCE_DIR "/scripts/prelude/cardan/") + module + ".lua");
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    const Finished names =
        look(std::string("local n = {} for k in pairs(") + module + ") do n[#n + 1] = k end print('one of: ' .. table.concat(n, ', '))");
    for (const std::string& name : names_after(names.out, "one of: "))
      EXPECT_NE(text.find(std::string("function ") + module + "." + name), std::string::npos) << name;
  }
}

TEST(ScriptReference, HasEveryKeyOfTheTablesThatAreRead) {
  const Meta meta = read_meta();
  const std::string begin = "local sat = vehicle 'vehicle.yaml'\nlocal f = function() end\n";
  const std::map<std::string, std::string> tables = {
      {"MissionOptions", "mission { duration = 1, _no = 1 }"},
      {"IntegratorOptions", "mission { duration = 1, integrator = { _no = 1 } }"},
      {"OutputOptions", "mission { duration = 1, output = { _no = 1 } }"},
      {"BudgetOptions", "mission { duration = 1, budget = { _no = 1 } }"},
      {"ControllerOptions", "controller { name = 'a', rate = 1, step = f, _no = 1 }"},
      {"PhaseOptions", "phase { name = 'a', _no = 1 }"},
      {"EventOptions", "event { name = 'a', when = f, action = f, _no = 1 }"},
      {"SequenceOptions", "sequence { name = 'a', run = f, _no = 1 }"},
      {"CheckOptions", "check { name = 'a', value = f, below = 1, _no = 1 }"},
      {"FigureOptions", "figure { name = 'a', value = f, _no = 1 }"},
      {"SignalOptions", "signals { a = { _no = 1 } }"},
      {"LoadOptions", "sat:node('rod'):load { _no = 1 }"},
      {"LinearPorts", "sim:linearize { _no = 1 }"},
      {"ModesOptions", "sim:system_modes { _no = 1 }"},
      {"IkTask", "sim:inverse_kinematics { targets = {}, _no = 1 }"},
      {"EquilibriumTask", "sim:equilibrium { move = {'rod'}, _no = 1 }"},
      {"IkTarget", "sim:inverse_kinematics { targets = {{ node = 'rod', position = {1, 2, 3}, _no = 1 }} }"},
      {"TaskOptions", "sim:operators():task { nodes = {'rod'}, _no = 1 }"},
      {"ClosedTaskOptions", "sim:closed_system():task { nodes = {'rod'}, _no = 1 }"}};
  for (const auto& [name, statement] : tables) {
    const TemporaryFolder dir;
    std::ofstream(dir / "scenario.lua") << begin + statement;
    std::ofstream(dir / "vehicle.yaml") << file_text(CARDAN_SOURCE_DIR "/tests/scripts/errors/pendulum.yaml");
    const Finished run = run_program({"check", "."}, dir.path());
    EXPECT_EQ(names_after(run.err, "one of the keys: "), meta.fields.at(name)) << name << "\n" << run.err;
  }
}

TEST(ScriptReference, TheDocumentsListEveryMethod) {
  const Meta meta = read_meta();
  std::string text;
  for (const char* page : {"scenario_lua.md", "workbench.md", "operators.md"})
    text += file_text(std::string(CARDAN_SOURCE_DIR "/docs/") + page);
  for (const auto& [name, functions] : meta.functions)
    for (const std::string& f : functions) {
      const bool listed = text.find(":" + f + "(") != std::string::npos || text.find(":" + f + "{") != std::string::npos ||
                          text.find("`" + f) != std::string::npos || text.find("." + f + "(") != std::string::npos;
      EXPECT_TRUE(listed) << name << " " << f;
    }
  for (const char* table :
       {"MissionOptions", "IntegratorOptions", "OutputOptions", "BudgetOptions", "ControllerOptions", "PhaseOptions", "EventOptions",
        "SequenceOptions", "WaitOptions", "CheckOptions", "FigureOptions", "SignalOptions", "ProfileOptions", "IkTarget"})
    for (const std::string& key : meta.fields.at(table)) EXPECT_NE(text.find(key), std::string::npos) << table << " " << key;
}

TEST(Help, TellsAboutObjectsFunctionsAndNames) {
  const Finished run = look(R"(
local sat = sim:vehicle()
local function has(text, ...)
  for _, part in ipairs { ... } do assert(text:find(part, 1, true), part .. '\n' .. text) end
end
has(tostring(help), 'controller(options)', 'vehicle(path, [values])', 'sim', 'operators', 'vec')
assert(help() == tostring(help))
for line in tostring(help):gmatch '[^\n]+' do assert(not line:find('^  [%w()]+%s*$'), line) end  -- each has a word about it
has(help 'task', 'An operational space')
has(help 'linearize', 'scene:linearize([ports])', 'inputs?', 'outputs?', 'file?', 'drift', 'poles')
has(help(sim.linearize), 'linearize([ports])', 'inputs?')
has(help(sim), 'sim:run_to(t)', 'sim:linearize([ports])', 'sim:inverse_kinematics(task)')
has(help(sat), 'vehicle:hinge(body)', 'vehicle:system_modes([options])')
has(help(sat:hinge 'wing_left'), 'hinge:rate([component])', 'hinge:profile(options)')
has(help(sat:hinge('wing_left').profile), 'rate_table?', 'sine?', 'amplitude', 'component?')
has(help(sim:operators()), 'operators:subtree(body)', 'P_plus', 'operators:linearize([ports])')
has(help(sim:operators().phi), 'operator:star()')
has(help(vector { 1 }), 'vector:norm()')
has(help(vec), 'vec.scale(s, a)')
has(help(vec.scale), 'either order')
has(help(controller), 'step', 'rate?')
has(help 'inverse_kinematics', 'targets', 'rotation_weight?', '1 2 3 rotation, 4 5 6 position', 'at_limit')
has(help 'mission', 'duration', 'budget?', 'relative?', 'mission.time()')
has(help(mission), 'mission.phase()')
has(help 'string', 'format', 'Lua 5.4')
has(help(print), 'Lua')
local ok, why = pcall(help, 'linearise')
assert(not ok and tostring(why):find('did you mean "linearize"', 1, true), tostring(why))
)");
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

}  // namespace
}  // namespace cardan
