#include "scripts/bindings/bind.hpp"

namespace cardan {

void refuse(lua_State* L, Code code, std::string key_path, std::string expected, std::string got, std::string hint) {
  throw InputError(Diagnostic{code,
                              {std::move(key_path), LuaHost::caller(L)},
                              std::move(expected),
                              std::move(got),
                              std::move(hint),
                              LuaHost::traceback(L),
                              {},
                              0});
}

void expect_setup(lua_State* L, const Scenario& s, const char* what, bool needs_vehicle) {
  if (s.stage != Scenario::Stage::setup)
    refuse(L, Code::lua_argument, what, "a declaration before the run", "one during the run",
           "move it to the top level of the script");
  if (needs_vehicle && !s.model)
    refuse(L, Code::lua_argument, what, "a vehicle before it", "no vehicle yet",
           "begin with: local sat = vehicle \"vehicle.yaml\"");
}

}  // namespace cardan
