#include "core/dynamics/fields.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/abi/field_family.hpp"
#include "core/base/finite.hpp"
#include "core/soa/field_pull.hpp"

namespace cardan {
namespace {

/// Beyond a limit that the field knows no value behind.
bool unknown(const FieldSource& f, int beyond) {
  for (std::uint32_t i = 0; i < f.family->n_limits; ++i)
    if ((beyond >> i & 1) != 0 && !f.family->limits[i].holds) return true;
  return beyond < 0;
}

/// out[i] = sum over k of R[3 k + i] a[k]: from world axes to those of a node.
void turn(const double* R, const double* a, double* out) {
  for (int i = 0; i < 3; ++i) out[i] = R[i] * a[0] + R[3 + i] * a[1] + R[6 + i] * a[2];
}

}  // namespace

FieldMoments::FieldMoments(const Model& model) : model_(model), all_(model.fields.size()) {
  for (std::size_t i = 0; i < all_.size(); ++i) all_[i].prepared = model.fields[i].source->prepared;
}

const FieldMoment& FieldMoments::at(int field, double t) {
  One& one = all_[field];
  const FieldSource& f = *model_.fields[field].source;
  if (f.family->prepare && !(one.known && one.moment.t == t)) {
    one.moment.beyond = f.family->prepare(t, f.packed.data(), one.prepared.data());
    one.known = true;
  }
  one.moment.t = t, one.moment.prepared = one.prepared.empty() ? nullptr : one.prepared.data();  // a copy of this has its own
  return one.moment;
}

std::size_t FieldMoments::bytes() const {
  std::size_t sum = all_.size() * sizeof(One);
  for (const One& one : all_) sum += one.prepared.size() * sizeof(double);
  return sum;
}

std::shared_ptr<const FieldMoment> kept_moment(const Model& model, const FieldMoment* at) {
  if (!model.field.source || !at) return nullptr;
  struct Kept {
    std::vector<double> prepared;
    FieldMoment moment;
  };
  const auto kept = std::make_shared<Kept>();
  kept->prepared.resize(model.field.source->prepared.size());
  if (at->prepared) std::memcpy(kept->prepared.data(), at->prepared, model.field.source->family->prepared_size);
  kept->moment = {at->t, kept->prepared.empty() ? nullptr : kept->prepared.data(), at->beyond};
  return {kept, &kept->moment};
}

int field_of_gravity(const Model& model) {
  if (!model.field.source) return -1;
  for (std::size_t i = 0; i < model.fields.size(); ++i)
    if (model.fields[i].source.get() == model.field.source) return static_cast<int>(i);
  return -1;
}

std::string told_name(const Field& field) {
  return is_of_plugin(field.origin) ? fmt::format("{} ({}, {})", field.name, field.source->family->type, field.origin) : field.name;
}

std::string told_beyond(const Field& field, int beyond) {
  const FieldSource& f = *field.source;
  for (std::uint32_t i = 0; i < f.family->n_limits; ++i)
    if ((beyond & ~f.held) >> i & 1)
      return fmt::format("{} is asked beyond its limit {}: {}", told_name(field), f.family->limits[i].name, f.family->limits[i].meaning);
  return beyond < 0 ? fmt::format("{}: evaluate returned {}", told_name(field), beyond) : "";
}

std::string held_text(const Field& field, int beyond) {
  const cardan_field_family& f = *field.source->family;
  std::string names;
  for (std::uint32_t i = 0; i < f.n_limits; ++i)
    if ((beyond >> i & 1) != 0) names += (names.empty() ? "" : ", ") + std::string(f.limits[i].name);
  return fmt::format("{} holds what it has at the end of what it knows ({})", field.name, names);
}

FieldsOfDevices::FieldsOfDevices(const Model& model) : model_(model), moments_(model), held_(model.fields.size(), 0) {
  std::size_t most = 0;
  for (std::size_t i = 0; i < model.devices.all.size(); ++i) {
    const Device& d = model.devices.all[i];
    for (std::size_t k = 0; k < d.mounts.size(); ++k) {
      const DeviceMount& m = d.mounts[k];
      if (m.field < 0) continue;
      const bool in_steps = d.acts && (m.at < 0 || (d.mounts[m.at].use & CARDAN_USE_ACCELERATION) == 0);
      auto group = std::ranges::find_if(groups_, [&](const Group& g) { return g.field == m.field && g.in_steps == in_steps; });
      if (group == groups_.end()) group = groups_.insert(groups_.end(), {m.field, in_steps, {}});
      const bool placed = !is_of_time(model.fields[m.field].source->family->quantity);
      group->readers.push_back({static_cast<int>(i), d.mount + static_cast<int>(k), placed ? d.mount + m.at : -1});
      most = std::max(most, group->readers.size());
    }
  }
  points_.resize(3 * most), values_.resize(CARDAN_FIELD_NUMBERS * most), gradients_.resize(3 * CARDAN_FIELD_NUMBERS * most);
}

/// Its points; how many.
int FieldsOfDevices::place(const Group& group, const std::vector<cardan_mount_motion>& motions) {
  const bool placed = !is_of_time(model_.fields[group.field].source->family->quantity);
  const auto n = static_cast<int>(placed ? group.readers.size() : 1);
  for (int i = 0; placed && i < n; ++i) std::copy_n(motions[group.readers[i].node].position, 3, points_.begin() + 3 * i);
  return n;
}

void FieldsOfDevices::visit(double t, const std::vector<cardan_mount_motion>& motions, const Visit& visit) {
  for (const Group& group : groups_) {
    const int n = place(group, motions);
    visit(group.field, moments_.at(group.field, t), n, points_.data());
  }
}

/// Bits of limits; -1 where something is not finite.
int FieldsOfDevices::ask(const Group& group, double t, const std::vector<cardan_mount_motion>& motions, bool gradients) {
  const FieldSource& f = *model_.fields[group.field].source;
  const bool placed = !is_of_time(f.family->quantity);
  const int n = place(group, motions);
  asked_ = group.field;
  const int beyond = soa::ask_field(f, moments_.at(group.field, t), n, placed ? points_.data() : nullptr, values_.data(),
                                    gradients && placed ? gradients_.data() : nullptr);
  asked_ = -1;
  return all_finite(values_.data(), n * static_cast<int>(field_size(f.family->quantity))) ? beyond : -1;
}

/// After ask(), which found a limit that is refused: which reader is the first beyond one.
int FieldsOfDevices::first_beyond(const Group& group, double t) {
  const FieldSource& f = *model_.fields[group.field].source;
  const FieldMoment& when = moments_.at(group.field, t);
  const cardan_field_args args{sizeof args, t, f.packed.data(), when.prepared};
  for (std::size_t i = 0; i + 1 < group.readers.size() && !is_of_time(f.family->quantity) && !f.refuses(when.beyond); ++i)
    if (double value[CARDAN_FIELD_NUMBERS]; f.refuses(f.family->evaluate(&args, 1, points_.data() + 3 * i, value, nullptr)))
      return group.readers[i].device;
  return is_of_time(f.family->quantity) || f.refuses(when.beyond) ? group.readers.front().device : group.readers.back().device;
}

bool FieldsOfDevices::look(double t, bool in_steps, std::vector<cardan_mount_motion>& motions, FieldFault& fault) {
  passed_.device = -1;
  if (in_steps) std::ranges::fill(held_, 0);
  for (const Group& group : groups_) {
    if (group.in_steps != in_steps) continue;
    const Field& field = model_.fields[group.field];
    const int beyond = ask(group, t, motions, false);
    if (field.source->refuses(beyond)) {
      const std::uint32_t of_each = field_size(field.source->family->quantity);
      const bool numbers =
          all_finite(values_.data(), static_cast<int>(of_each * (is_of_time(field.source->family->quantity) ? 1 : group.readers.size())));
      passed_ = {first_beyond(group, t), beyond >= 0 ? told_beyond(field, beyond)
                                         : numbers   ? fmt::format("the field {}: evaluate returned {}", told_name(field), beyond)
                                                     : fmt::format("the field {} is not finite", told_name(field))};
      if (unknown(*field.source, beyond)) {
        fault = passed_;
        if (beyond > 0) stopped_ = passed_;
        return false;
      }
    }
    held_[group.field] |= beyond;
    const std::uint32_t quantity = field.source->family->quantity, size = field_size(quantity);
    for (std::size_t i = 0; i < group.readers.size(); ++i) {
      const Reader& r = group.readers[i];
      const double* value = values_.data() + (r.node < 0 ? 0 : size * i);
      double* to = motions[r.mount].field;
      std::copy_n(value, size, to);
      if (is_field_vector(quantity)) turn(motions[r.node].R_WN, value, to);
    }
  }
  return true;
}

void FieldsOfDevices::edges(double t, const std::vector<cardan_mount_motion>& motions, double* g) {
  for (const FieldEdges& e : model_.devices.edges) {
    const FieldSource& f = *model_.fields[e.field].source;
    asked_ = e.field;
    const cardan_field_args args{sizeof args, t, f.packed.data(), moments_.at(e.field, t).prepared};
    f.family->edges(&args, motions[e.mount].position, g + e.first);
    asked_ = -1;
  }
}

void FieldsOfDevices::look_along(double t, bool in_steps, const std::vector<cardan_mount_motion>& motions,
                                 std::vector<cardan_mount_motion>& rates) {
  for (const Group& group : groups_) {
    if (group.in_steps != in_steps) continue;
    const std::uint32_t quantity = model_.fields[group.field].source->family->quantity, size = field_size(quantity);
    if (is_of_time(quantity)) continue;
    ask(group, t, motions, true);
    for (std::size_t i = 0; i < group.readers.size(); ++i) {
      const Reader& r = group.readers[i];
      const double *value = values_.data() + size * i, *G = gradients_.data() + 3 * size * i, *dp = rates[r.node].position;
      double along[CARDAN_FIELD_NUMBERS] = {};
      for (std::uint32_t k = 0; k < size; ++k) along[k] = G[3 * k] * dp[0] + G[3 * k + 1] * dp[1] + G[3 * k + 2] * dp[2];
      double* to = rates[r.mount].field;
      std::copy_n(along, size, to);
      if (!is_field_vector(quantity)) continue;
      double turned[3];
      turn(motions[r.node].R_WN, along, to);
      turn(rates[r.node].R_WN, value, turned);
      for (int k = 0; k < 3; ++k) to[k] += turned[k];
    }
  }
}

std::size_t FieldsOfDevices::bytes() const {
  return moments_.bytes() + (points_.size() + values_.size() + gradients_.size()) * sizeof(double);
}

}  // namespace cardan
