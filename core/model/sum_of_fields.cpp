#include "core/model/sum_of_fields.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "core/abi/field_family.hpp"

namespace cardan {
namespace {

constexpr std::size_t kNumbers = field_size(CARDAN_GRAVITY), kSlopes = 3 * kNumbers, kPotential = 3;
constexpr unsigned kOfAll =
    CARDAN_FIELD_GRADIENT | CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_STEADY | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;

struct SumOfFields : FieldSource {
  struct Part {
    std::shared_ptr<const FieldSource> source;
    std::size_t prepared;  // where its own begins [doubles]
    std::uint32_t limit;   // its first bit
  };
  cardan_field_family table{};
  std::vector<Part> parts;
  std::vector<std::string> names;
  std::vector<cardan_limit_desc> limits;

  static const SumOfFields& of(const void* packed) {
    const SumOfFields* sum = nullptr;
    std::memcpy(&sum, packed, sizeof sum);
    return *sum;
  }
  static int shifted(int code, std::uint32_t by) { return code < 0 ? code : static_cast<int>(static_cast<unsigned>(code) << by); }

  static int prepare(double t, const void* packed, void* prepared) {
    int code = 0;
    for (const Part& p : of(packed).parts)
      if (const cardan_field_family& f = *p.source->family; f.prepare)
        code |= shifted(f.prepare(t, p.source->packed.data(), static_cast<double*>(prepared) + p.prepared), p.limit);
    return code;
  }

  static int evaluate(const cardan_field_args* a, std::uint32_t n, const double* points, double* values, double* gradients) {
    const SumOfFields& sum = of(a->packed);
    const bool potential = (sum.table.facts & CARDAN_FIELD_POTENTIAL) != 0;
    int code = 0;
    std::fill_n(values, kNumbers * n, 0.0);
    if (gradients) std::fill_n(gradients, kSlopes * n, 0.0);
    for (const Part& p : sum.parts) {
      const void* prepared = a->prepared ? static_cast<const double*>(a->prepared) + p.prepared : nullptr;
      const cardan_field_args args{sizeof args, a->t, p.source->packed.data(), prepared};
      for (std::uint32_t i = 0; i < n; ++i) {
        double value[kNumbers], slope[kSlopes];
        code |= shifted(p.source->family->evaluate(&args, 1, points + 3 * i, value, gradients ? slope : nullptr), p.limit);
        for (std::size_t k = 0; k < kNumbers; ++k) values[kNumbers * i + k] += value[k];
        for (std::size_t k = 0; gradients && k < kSlopes; ++k) gradients[kSlopes * i + k] += slope[k];
      }
    }
    for (std::uint32_t i = 0; i < n && !potential; ++i) {
      values[kNumbers * i + kPotential] = 0.0;
      if (gradients) std::fill_n(gradients + kSlopes * i + 3 * kPotential, 3, 0.0);
    }
    return code;
  }
};

}  // namespace

Field sum_of_fields(const std::vector<Field>& parts) {
  auto sum = std::make_shared<SumOfFields>();
  Field out;
  out.origin = parts.front().origin;
  cardan_field_family& t = sum->table;
  t.struct_size = sizeof t, t.type = "sum", t.summary = "gravity of several fields", t.quantity = CARDAN_GRAVITY, t.facts = kOfAll;
  t.evaluate = &SumOfFields::evaluate;
  std::size_t doubles = 0;
  for (const Field& field : parts) {
    const cardan_field_family& f = *field.source->family;
    const auto first = static_cast<std::uint32_t>(sum->names.size());
    sum->parts.push_back({field.source, doubles, first});
    doubles += field.source->prepared.size();
    sum->prepared.insert(sum->prepared.end(), field.source->prepared.begin(), field.source->prepared.end());
    if (f.prepare) t.prepare = &SumOfFields::prepare;
    t.facts &= f.facts;
    t.distance = std::max(t.distance, f.distance);
    for (std::uint32_t i = 0; i < f.n_limits; ++i) {
      sum->names.push_back(fmt::format("{}: {}", field.name, f.limits[i].name));
      sum->limits.push_back(f.limits[i]);
    }
    sum->held |= SumOfFields::shifted(field.source->held, first);
    if (is_of_plugin(field.origin)) out.origin = field.origin;
    out.name += (out.name.empty() ? "" : " + ") + field.name;
  }
  for (std::size_t i = 0; i < sum->names.size(); ++i) sum->limits[i].name = sum->names[i].c_str();
  t.limits = sum->limits.data(), t.n_limits = static_cast<std::uint32_t>(sum->limits.size()), t.limit_size = sizeof(cardan_limit_desc);
  t.prepared_size = static_cast<std::uint32_t>(doubles * sizeof(double));
  sum->family = &t;
  const SumOfFields* self = sum.get();
  t.params_size = sizeof self;
  sum->packed.assign(1, 0.0);
  std::memcpy(sum->packed.data(), &self, sizeof self);
  out.source = std::move(sum);
  return out;
}

}  // namespace cardan
