#include "core/model/column_order.hpp"

#include <algorithm>
#include <numeric>

namespace cardan {

namespace {

constexpr int kFewSlots = 8;  // six rows of memory each

/// Depth-first; `size`: columns of a body and all outboard of it; `outboard`: in which order.
ColumnOrder ordered(const SweepModel& model, const std::vector<int>& size, const std::vector<std::vector<int>>& outboard) {
  ColumnOrder order;
  order.of.resize(model.bodies.size());
  std::vector<int> next(outboard[0].rbegin(), outboard[0].rend());
  while (!next.empty()) {
    const auto k = static_cast<std::size_t>(next.back());
    next.pop_back();
    const SweepBody& b = model.bodies[k];
    const auto parent = static_cast<std::size_t>(b.parent);
    ColumnOrder::Of& own = order.of[k];
    own.begin = static_cast<int>(order.v.size());
    own.end = own.begin + size[k];
    own.limit = parent > 0 ? order.of[parent].limit : own.end;
    own.leaf = outboard[k].empty();
    own.last = outboard[parent].back() == static_cast<int>(k);
    // The last takes the place of the inboard body, which nothing needs after it; that of the ground stays.
    own.slot = order.of[parent].slot + (parent > 0 && own.last ? 0 : 1);
    order.slots = std::max(order.slots, own.slot + 1);
    order.bodies.push_back(static_cast<int>(k));
    for (int j = 0; j < b.nv; ++j) order.v.push_back(b.v + j);
    order.ends.insert(order.ends.end(), static_cast<std::size_t>(b.nv), own.end);
    next.insert(next.end(), outboard[k].rbegin(), outboard[k].rend());
  }
  std::vector<int> given(order.v.size());
  std::iota(given.begin(), given.end(), 0);
  order.as_given = order.v == given;
  order.one_chain = std::ranges::all_of(order.ends, [&](int end) { return end == static_cast<int>(order.v.size()); });
  return order;
}

}  // namespace

ColumnOrder column_order(const SweepModel& model) {
  const std::size_t n = model.bodies.size();
  std::vector<std::vector<int>> outboard(n);
  std::vector<int> size(n);
  for (std::size_t k = n - 1; k >= 1; --k) {
    const SweepBody& b = model.bodies[k];
    size[k] += b.nv;
    size[static_cast<std::size_t>(b.parent)] += size[k];
  }
  for (std::size_t k = 1; k < n; ++k) outboard[static_cast<std::size_t>(model.bodies[k].parent)].push_back(static_cast<int>(k));
  const auto sorted_by = [&](const auto& key) {
    for (auto& list : outboard) std::ranges::stable_sort(list, {}, [&](int k) { return key(static_cast<std::size_t>(k)); });
    return ordered(model, size, outboard);
  };
  ColumnOrder given = sorted_by([&](std::size_t k) { return model.bodies[k].v; });
  return given.as_given && given.slots <= kFewSlots ? given : sorted_by([&](std::size_t k) { return size[k]; });
}

}  // namespace cardan
