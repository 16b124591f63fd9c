#pragma once
// Sparse matrices as text in the Matrix Market format (Boisvert, Pozo, Remington 1996), which most finite-element programs can write.
#include <initializer_list>
#include <string>

#include "core/base/diagnostic.hpp"
#include "core/linalg/sparse_factor.hpp"

namespace cardan {

/// A symmetric matrix with one of these numbers of rows and columns for each node, 3 or 6, and `more` behind them: `matrix coordinate real`
/// or `integer`, `symmetric` or `general`; entries that stand twice are added, as an assembly means them. Its result is symmetric to the
/// last bit. Throws InputError with the line: C0102 where the file cannot be opened, C0321 where it is another one, has numbers that are
/// none, or is not symmetric to 1e-9 of its entries.
SparseMatrix read_symmetric_matrix(const std::string& path, int nodes, std::initializer_list<int> per_node, int more, const Located& at);

}  // namespace cardan
