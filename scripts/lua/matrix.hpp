#pragma once
// Numbers in bulk for scripts: `vector` and `matrix`, values with names and units along each side. The numbers lie in
// Lua's own memory, so that the budget counts them; operations cost steps as their arithmetic does.
#include <Eigen/Core>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "scripts/lua/host.hpp"

namespace cardan {

/// What the entries along one side are: "rod.angle" in "rad". Each list has one text per entry, or none at all.
struct Labels {
  std::vector<std::string> names, units;
  bool operator==(const Labels&) const = default;
};

/// Makes the types and the globals `vector` and `matrix`; before any of the rest.
void open_matrices(LuaHost& host);

// Inside protect. These copy.
void push_vector(lua_State* L, const Eigen::Ref<const Eigen::VectorXd>& x, Labels labels = {});
void push_matrix(lua_State* L, const Eigen::Ref<const Eigen::MatrixXd>& A, Labels rows = {}, Labels columns = {});

inline constexpr Eigen::Index kAnySize = -1;
/// The vector, or table of numbers, at `index`; InputError C0502 at the script's line otherwise. `what` names it in
/// messages ("the velocity"), `size` is the one that fits.
Eigen::VectorXd to_vector(lua_State* L, int index, Eigen::Index size, const std::string& what);
/// The matrix, or table of rows, at `index`.
Eigen::MatrixXd to_matrix(lua_State* L, int index, Eigen::Index rows, Eigen::Index cols, const std::string& what);

/// Of the rows or columns; empty for anything but a vector or a matrix.
Labels row_labels(lua_State* L, int index);
Labels column_labels(lua_State* L, int index);
/// The numbers of a vector or matrix themselves, column after column; empty for anything else.
std::span<double> numbers_of(lua_State* L, int index);

bool is_vector(lua_State* L, int index);
bool is_matrix(lua_State* L, int index);

/// The path of a file that a script writes: inside of LuaOptions::output, whose folders are made. InputError C0701 where
/// scripts write nothing, or the name leads out of it.
std::filesystem::path output_file(lua_State* L, const std::string& name);
/// Pushes what a function that writes a file returns: where it is, seen from the folder where the program runs.
int push_path(lua_State* L, const std::filesystem::path& path);

}  // namespace cardan
