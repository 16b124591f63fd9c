#include "scripts/host/lua_function.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"

namespace cardan {

LuaRef LuaRef::pop(lua_State* L) {
  LuaRef r;
  r.ref_ = luaL_ref(L, LUA_REGISTRYINDEX);
  r.host_ = &LuaHost::of(L);
  return r;
}

LuaRef::~LuaRef() {
  if (host_) luaL_unref(host_->state(), LUA_REGISTRYINDEX, ref_);  // allocates nothing, raises nothing
}

std::string describe_value(lua_State* L, int index) {
  switch (lua_type(L, index)) {
    case LUA_TSTRING: {
      std::size_t n = 0;
      const char* text = lua_tolstring(L, index, &n);
      return in_quotes({text, n}) + " (string)";
    }
    case LUA_TNUMBER:
      if (lua_isinteger(L, index)) return fmt::format("{} (number)", lua_tointeger(L, index));
      if (std::isnan(lua_tonumber(L, index))) return "nan (number)";  // its sign differs between processors
      return fmt::format("{} (number)", lua_tonumber(L, index));
    case LUA_TBOOLEAN:
      return lua_toboolean(L, index) ? "true (boolean)" : "false (boolean)";
    default:
      return luaL_typename(L, index);
  }
}

// ---- records ----

LuaRecord::LuaRecord(LuaHost& host, std::vector<LuaField> fields) {
  host.protect([&](lua_State* L) {
    lua_createtable(L, 0, static_cast<int>(fields.size()));
    table_ = LuaRef::pop(L);
    for (LuaField& field : fields) {
      Field f;
      lua_pushlstring(L, field.name.data(), field.name.size());
      f.key = LuaRef::pop(L);
      if (field.size > 1) {
        lua_createtable(L, field.size, 0);
        f.array = LuaRef::pop(L);
      }
      n_values_ += field.size;
      f.is = std::move(field);
      fields_.push_back(std::move(f));
    }
  });
}

void LuaRecord::push(lua_State* L, std::span<const double> values) const {
  table_.push(L);
  const double* value = values.data();
  for (const Field& field : fields_) {
    field.key.push(L);
    if (field.array) {
      field.array.push(L);
      for (int i = 1; i <= field.is.size; ++i) {
        lua_pushnumber(L, *value++);
        lua_rawseti(L, -2, i);
      }
    } else {
      lua_pushnumber(L, *value++);
    }
    lua_rawset(L, -3);
  }
}

std::optional<LuaRecordFault> LuaRecord::fault(lua_State* L, LuaRecordFault::Kind kind, const Field* field,
                                               int element) const {
  LuaRecordFault f{kind, field ? field->is.name : std::string{}, "a finite number", describe_value(L, -1)};
  if (field && element > 0) f.field += fmt::format("[{}]", element);
  if (field && element == 0 && field->is.size > 1) f.expected = fmt::format("an array of {} numbers", field->is.size);
  if (!field) {
    f.expected.clear();
    for (const Field& known : fields_) f.expected += (f.expected.empty() ? "a table with " : ", ") + known.is.name;
  }
  return f;
}

std::optional<LuaRecordFault> LuaRecord::read_number(lua_State* L, const Field& field, int element,
                                                     double& value) const {
  if (lua_type(L, -1) != LUA_TNUMBER)
    return fault(L, lua_isnil(L, -1) ? LuaRecordFault::missing : LuaRecordFault::wrong_type, &field, element);
  value = lua_tonumber(L, -1);
  if (!std::isfinite(value)) return fault(L, LuaRecordFault::not_finite, &field, element);
  return {};
}

std::optional<LuaRecordFault> LuaRecord::read(lua_State* L, int index, std::span<double> values) const {
  const int table = lua_absindex(L, index), top = lua_gettop(L);
  std::optional<LuaRecordFault> found;
  const auto end = [&](std::optional<LuaRecordFault> f) {
    lua_settop(L, top);
    return f;
  };
  lua_pushvalue(L, table);
  if (!lua_istable(L, table)) return end(fault(L, LuaRecordFault::not_a_table, nullptr, 0));
  lua_pop(L, 1);

  double* value = values.data();
  for (const Field& field : fields_) {
    field.key.push(L);
    lua_rawget(L, table);
    if (field.is.size == 1) {
      if ((found = read_number(L, field, 0, *value++))) return end(std::move(found));
    } else {
      if (!lua_istable(L, -1))
        return end(fault(L, lua_isnil(L, -1) ? LuaRecordFault::missing : LuaRecordFault::wrong_type, &field, 0));
      for (int i = 1; i <= field.is.size; ++i) {
        lua_rawgeti(L, -1, i);
        if ((found = read_number(L, field, i, *value++))) return end(std::move(found));
        lua_pop(L, 1);
      }
      if (lua_rawlen(L, -1) != static_cast<lua_Unsigned>(field.is.size)) {
        lua_rawgeti(L, -1, field.is.size + 1);
        return end(fault(L, LuaRecordFault::extra, &field, field.is.size + 1));
      }
    }
    lua_pop(L, 1);
  }

  std::size_t n_keys = 0;
  for (lua_pushnil(L); lua_next(L, table); lua_pop(L, 1)) ++n_keys;
  if (n_keys == fields_.size()) return {};
  for (lua_pushnil(L); lua_next(L, table); lua_pop(L, 1)) {
    lua_pushvalue(L, -2);
    std::size_t n = 0;
    const char* text = lua_tolstring(L, -1, &n);
    const std::string key = text ? std::string(text, n) : luaL_typename(L, -1);
    const auto is_key = [&](const Field& f) { return f.is.name == key; };
    lua_pop(L, 1);
    if (std::any_of(fields_.begin(), fields_.end(), is_key) || (found && found->field < key)) continue;
    found = fault(L, LuaRecordFault::extra, nullptr, 0);
    found->field = key;  // the smallest one: their order in the table differs from run to run
  }
  return end(std::move(found));
}

// ---- calls ----

SourceMark LuaFunction::defined_at() const {
  SourceMark mark;
  host_->protect([&](lua_State* L) {
    push(L);
    mark = host_->definition(L, -1);
  });
  return mark;
}

void LuaFunction::call(std::span<const double> in, std::span<double> out, const LuaBudget& budget) const {
  host_->protect(
      [&](lua_State* L) {
        luaL_checkstack(L, static_cast<int>(in.size() + out.size()) + LUA_MINSTACK, nullptr);
        push(L);
        for (const double x : in) lua_pushnumber(L, x);
        lua_call(L, static_cast<int>(in.size()), static_cast<int>(out.size()));
        for (std::size_t i = 0; i < out.size(); ++i) {
          const int at = static_cast<int>(i) + 1;
          out[i] = lua_tonumber(L, at);
          if (lua_type(L, at) == LUA_TNUMBER && std::isfinite(out[i])) continue;
          push(L);
          throw InputError(Diagnostic{Code::lua_runtime,
                                      {fmt::format("result {}", at), host_->definition(L, -1)},
                                      "a finite number",
                                      describe_value(L, at),
                                      {},
                                      {},
                                      {},
                                      0});
        }
      },
      budget);
}

std::optional<LuaRecordFault> LuaFunction::tick(double t, const LuaRecord& input, std::span<const double> in,
                                                const LuaRecord& output, std::span<double> out,
                                                const LuaBudget& budget) const {
  std::optional<LuaRecordFault> fault;
  host_->protect(
      [&](lua_State* L) {
        push(L);
        lua_pushnumber(L, t);
        input.push(L, in);
        lua_call(L, 2, 1);
        fault = output.read(L, -1, out);
      },
      budget);
  return fault;
}

}  // namespace cardan
