#include "core/model/params.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/abi/param_values.hpp"
#include "core/base/units.hpp"
#include "core/model/schema.hpp"

namespace cardan {
namespace {

class ParamsReader {
 public:
  ParamsReader(const SystemSpec& spec, const GivenParams& given, const ParamsOfFamily& family, DiagnosticSink& sink)
      : spec_(spec), who_(given), given_(given.values), family_(family), sink_(sink) {}

  /// The packed bytes; empty after a fault.
  std::vector<double> packed() {
    for (const cardan_param_desc& desc : family_.schema) read(desc);
    check_names();
    if (failed_) return {};
    std::vector<double> bytes = pack(family_.bytes, family_.pack, table_);
    for (const auto& [name, expected] : table_.failures) report_refused(name, expected);
    return bytes;
  }

 private:
  void fault(Code code, const std::string& name, std::string expected, std::string got, std::string hint = {}) {
    failed_ = true;
    sink_.report(code, spec_.locate(name.empty() ? who_.path : fmt::format("{}.{}", who_.path, name)), std::move(expected), std::move(got),
                 std::move(hint));
  }

  void read(const cardan_param_desc& desc) {
    const auto given = given_.find(desc.name);
    if (given == given_.end()) {
      if (desc.required) return fault(Code::missing_key, desc.name, fmt::format("{}: {}", desc.name, desc.meaning), "no such key");
      if (desc.kind == CARDAN_NUMBER) table_.numbers[desc.name] = {desc.fallback[0]};
      if (desc.kind == CARDAN_VECTOR || desc.kind == CARDAN_UNIT_VECTOR) table_.numbers[desc.name] = {desc.fallback, desc.fallback + 3};
      return;
    }
    const ParamValue& value = given->second;
    if (desc.kind == CARDAN_TEXT) {
      const auto* text = std::get_if<std::string>(&value.value);
      if (!text) return fault(Code::wrong_type, desc.name, fmt::format("a text: {}", desc.meaning), "something else");
      table_.texts[desc.name] = *text;
      return;
    }
    std::vector<double> numbers = as_given(value);
    if (!count_fits(desc, numbers.size())) return;
    if (!std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); }))
      return fault(Code::out_of_range, desc.name, "finite numbers", "a value that is not finite");
    if (desc.kind == CARDAN_UNIT_VECTOR || desc.kind == CARDAN_UNIT_VECTORS)
      for (std::size_t i = 0; i < numbers.size(); i += 3) {
        Eigen::Map<Eigen::Vector3d> axis(numbers.data() + i);
        if (axis.isZero(0.0)) return fault(Code::bad_axes, desc.name, "an axis that is not all zero", vectors_text(as_given(value)));
        axis.stableNormalize();
      }
    table_.numbers[desc.name] = std::move(numbers);
  }

  static std::vector<double> as_given(const ParamValue& value) {
    if (const auto* one = std::get_if<double>(&value.value)) return {*one};
    if (const auto* list = std::get_if<std::vector<double>>(&value.value)) return *list;
    return {};
  }

  bool count_fits(const cardan_param_desc& desc, std::size_t got) {
    const bool one_vector = desc.kind == CARDAN_VECTOR || desc.kind == CARDAN_UNIT_VECTOR;
    const std::size_t wanted = desc.kind == CARDAN_NUMBER ? 1 : one_vector ? 3 : 3 * std::size_t{desc.count};
    if (got > 0 && (wanted > 0 ? got == wanted : got % 3 == 0)) return true;
    const std::string expected = desc.kind == CARDAN_NUMBER ? "one number"
                                 : one_vector               ? "a vector of 3 numbers"
                                 : wanted > 0               ? fmt::format("a list of {} vectors of 3 numbers", desc.count)
                                                            : "a list of vectors of 3 numbers";
    fault(Code::wrong_type, desc.name, expected, fmt::format("{} number{}", got, got == 1 ? "" : "s"));
    return false;
  }

  void check_names() {
    for (const auto& [name, value] : given_) {
      if (std::ranges::find(family_.schema, std::string_view(name), &cardan_param_desc::name) != family_.schema.end()) continue;
      std::vector<std::string> legal;
      for (const cardan_param_desc& desc : family_.schema) legal.emplace_back(desc.name);
      fault(Code::unknown_key, name,
            legal.empty() ? fmt::format("no parameters: {} takes none", who_.what)
                          : fmt::format("a parameter of {}: {}", who_.what, one_of(legal)),
            in_quotes(name), did_you_mean(name, legal));
    }
  }

  void report_refused(const std::string& name, const std::string& expected) {
    const auto numbers = table_.numbers.find(name);
    const auto text = table_.texts.find(name);
    const bool is_vector = numbers != table_.numbers.end() && numbers->second.size() % 3 == 0;
    std::string got = "nothing";
    if (numbers != table_.numbers.end())
      got = is_vector ? vectors_text(numbers->second) : fmt::format("{:.6g}", fmt::join(numbers->second, ", "));
    if (text != table_.texts.end()) got = in_quotes(text->second);
    fault(is_vector ? Code::bad_axes : Code::out_of_range, name, expected, got);
  }

  static std::string vectors_text(const std::vector<double>& n) {
    std::string out;
    for (std::size_t i = 0; i + 2 < n.size(); i += 3)
      out += fmt::format("{}[{:.6g}, {:.6g}, {:.6g}]", i == 0 ? "" : ", ", n[i], n[i + 1], n[i + 2]);
    return out;
  }

  const SystemSpec& spec_;
  const GivenParams& who_;
  const ParamValues& given_;
  const ParamsOfFamily& family_;
  DiagnosticSink& sink_;
  ParamTable table_;
  bool failed_ = false;
};

}  // namespace

std::vector<double> pack_params(const SystemSpec& spec, const GivenParams& given, const ParamsOfFamily& family, DiagnosticSink& sink) {
  return ParamsReader(spec, given, family, sink).packed();
}

}  // namespace cardan
