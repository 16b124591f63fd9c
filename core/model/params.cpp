#include "core/model/params.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <set>
#include <utility>

#include "core/base/units.hpp"

namespace cardan {
namespace {

bool is_unit_kind(const cardan_param_desc& d) { return d.kind == CARDAN_UNIT_VECTOR || d.kind == CARDAN_UNIT_VECTORS; }
bool is_one_vector(const cardan_param_desc& d) { return d.kind == CARDAN_VECTOR || d.kind == CARDAN_UNIT_VECTOR; }
bool takes_each(const cardan_param_desc& d) { return d.kind == CARDAN_VECTOR && (d.flags & CARDAN_EACH) != 0; }

constexpr std::uintmax_t kMostFileBytes = std::uintmax_t{1} << 30;  // of a file that is a parameter, all of it in memory

std::vector<std::string> choices(const cardan_param_desc& d) { return {d.names, d.names + d.count}; }
std::string column_unit(const cardan_param_desc& d, std::size_t i) { return d.units ? d.units[i] : d.unit; }
std::string columns(const cardan_param_desc& d) {
  std::string out;
  for (std::uint32_t i = 0; i < d.count; ++i) out += fmt::format("{}{} [{}]", i == 0 ? "" : ", ", d.names[i], column_unit(d, i));
  return out;
}

std::string vectors_text(const std::vector<double>& n) {
  std::string out;
  for (std::size_t i = 0; i + 2 < n.size(); i += 3)
    out += fmt::format("{}[{:.6g}, {:.6g}, {:.6g}]", i == 0 ? "" : ", ", n[i], n[i + 1], n[i + 2]);
  return out;
}

bool in_range(const cardan_param_desc& d, double x) {
  if (d.lower == 0.0 && d.upper == 0.0) return true;
  return (d.flags & CARDAN_ABOVE ? x > d.lower : x >= d.lower) && (d.flags & CARDAN_BELOW ? x < d.upper : x <= d.upper);
}

class Checker {
 public:
  Checker(const SystemSpec& spec, const GivenParams& given, ParamSchema schema, DiagnosticSink& sink)
      : spec_(spec), who_(given), schema_(schema), sink_(sink) {}

  std::optional<ParamTable> checked() {
    for (const cardan_param_desc& desc : schema_) {
      const auto given = who_.values.find(desc.name);
      if (given != who_.values.end())
        read(desc, given->second);
      else
        read_fallback(desc);
    }
    check_names();
    if (failed_) return {};
    return std::move(table_);
  }

 private:
  void fault(Code code, const std::string& name, std::string expected, std::string got, std::string hint = {}) {
    failed_ = true;
    sink_.report(code, spec_.locate(fmt::format("{}.{}", who_.path, name)), std::move(expected), std::move(got), std::move(hint));
  }

  void read_fallback(const cardan_param_desc& desc) {
    if (desc.flags & CARDAN_REQUIRED)
      return fault(Code::missing_key, desc.name, fmt::format("{}: {}", desc.name, desc.meaning), "no such key");
    if (is_one_vector(desc)) table_.numbers[desc.name] = {desc.fallback, desc.fallback + 3};
    if (desc.kind == CARDAN_NUMBER || desc.kind == CARDAN_INTEGER || desc.kind == CARDAN_TRUTH)
      table_.numbers[desc.name] = {desc.fallback[0]};
    if (desc.kind == CARDAN_CHOICE && desc.fallback[0] >= 0.0 && desc.fallback[0] < desc.count)
      choose(desc, static_cast<std::size_t>(desc.fallback[0]));
  }
  void choose(const cardan_param_desc& desc, std::size_t i) {
    table_.numbers[desc.name] = {static_cast<double>(i)};
    table_.texts[desc.name] = desc.names[i];
  }

  void read(const cardan_param_desc& desc, const ParamValue& value) {
    switch (desc.kind) {
      case CARDAN_TEXT:
      case CARDAN_CHOICE:
      case CARDAN_FILE:
        return read_text(desc, value);
      case CARDAN_TRUTH:
        if (const bool* truth = std::get_if<bool>(&value.value))
          table_.numbers[desc.name] = {*truth ? 1.0 : 0.0};
        else
          fault(Code::wrong_type, desc.name, fmt::format("true or false: {}", desc.meaning), "something else");
        return;
      default:
        return read_numbers(desc, value);
    }
  }

  void read_text(const cardan_param_desc& desc, const ParamValue& value) {
    const auto* text = std::get_if<std::string>(&value.value);
    if (!text) return fault(Code::wrong_type, desc.name, fmt::format("a text: {}", desc.meaning), "something else");
    if (desc.kind == CARDAN_CHOICE) {
      const std::vector<std::string> legal = choices(desc);
      const auto found = std::ranges::find(legal, *text);
      if (found == legal.end())
        return fault(Code::unknown_name, desc.name, fmt::format("{} ({})", one_of(legal), desc.meaning), in_quotes(*text),
                     did_you_mean(*text, legal));
      return choose(desc, static_cast<std::size_t>(found - legal.begin()));
    }
    table_.texts[desc.name] = *text;
    if (desc.kind != CARDAN_FILE) return;
    std::error_code unusable;
    std::ifstream file(*text, std::ios::binary);
    if (!std::filesystem::is_regular_file(*text, unusable) || !file)
      return fault(Code::file_not_found, desc.name, fmt::format("a file that can be read: {}", desc.meaning), in_quotes(*text),
                   "give its path relative to the vehicle file");
    if (const auto size = std::filesystem::file_size(*text, unusable); size > kMostFileBytes)
      return fault(Code::out_of_range, desc.name, fmt::format("a file of at most {} bytes", kMostFileBytes), fmt::format("{} bytes", size));
    table_.bytes[desc.name] = {std::istreambuf_iterator<char>(file), {}};
  }

  void read_numbers(const cardan_param_desc& desc, const ParamValue& value) {
    std::vector<double> numbers = as_given(value);
    if (takes_each(desc) && numbers.size() == 1) numbers.resize(3, numbers[0]);
    if (!count_fits(desc, numbers.size())) return;
    if (!std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); }))
      return fault(Code::out_of_range, desc.name, "finite numbers", "a value that is not finite");
    if (desc.kind == CARDAN_INTEGER && numbers[0] != std::floor(numbers[0]))
      return fault(Code::out_of_range, desc.name, "a whole number", fmt::format("{:.6g}", numbers[0]));
    if (desc.kind != CARDAN_TABLE)
      for (const double x : numbers)
        if (!in_range(desc, x))
          return fault(Code::out_of_range, desc.name,
                       fmt::format("{} {}",
                                   desc.kind == CARDAN_INTEGER ? "a whole number"
                                   : numbers.size() > 1        ? "numbers"
                                                               : "a number",
                                   range_text(desc)),
                       fmt::format("{:.6g}", x));
    if (is_unit_kind(desc))
      for (std::size_t i = 0; i < numbers.size(); i += 3) {
        Eigen::Map<Eigen::Vector3d> axis(numbers.data() + i);
        if (axis.isZero(0.0)) return fault(Code::bad_axes, desc.name, "a direction that is not all zero", vectors_text(as_given(value)));
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
    const bool one = desc.kind == CARDAN_NUMBER || desc.kind == CARDAN_INTEGER, table = desc.kind == CARDAN_TABLE;
    const std::size_t wanted = one ? 1 : is_one_vector(desc) ? 3 : table ? 0 : 3 * std::size_t{desc.count};
    if (got > 0 && (wanted > 0 ? got == wanted : got % (table ? desc.count : 3u) == 0)) return true;
    const std::string expected = one                   ? "one number"
                                 : takes_each(desc)    ? "a vector of 3 numbers, or one for all"
                                 : is_one_vector(desc) ? "a vector of 3 numbers"
                                 : table               ? "rows of " + columns(desc)
                                 : wanted > 0          ? fmt::format("a list of {} vectors of 3 numbers", desc.count)
                                                       : "a list of vectors of 3 numbers";
    fault(Code::wrong_type, desc.name, expected, fmt::format("{} number{}", got, got == 1 ? "" : "s"));
    return false;
  }

  void check_names() {
    for (const auto& [name, value] : who_.values) {
      if (std::ranges::find(schema_, std::string_view(name), &cardan_param_desc::name) != schema_.end()) continue;
      std::vector<std::string> legal;
      for (const cardan_param_desc& desc : schema_) legal.emplace_back(desc.name);
      fault(Code::unknown_key, name,
            legal.empty() ? fmt::format("no parameters: {} takes none", who_.what)
                          : fmt::format("a parameter of {}: {}", who_.what, one_of(legal)),
            in_quotes(name), did_you_mean(name, legal));
    }
  }

  const SystemSpec& spec_;
  const GivenParams& who_;
  ParamSchema schema_;
  DiagnosticSink& sink_;
  ParamTable table_;
  bool failed_ = false;
};

void read_rows(const DocRef& value, const cardan_param_desc& desc, ParamValue& param, ReadContext& context) {
  if (value.node->kind == DocNode::Kind::scalar) {
    param.file = value.node->text;
    param.value = read_table_file(beside(value.node->mark, param.file), desc, value.at(), context.sink);
    return;
  }
  std::vector<double> all;
  if (value.node->kind != DocNode::Kind::list)
    context.sink.report(Code::wrong_type, value.at(), fmt::format("a list of rows [{}], or the name of a CSV file", columns(desc)),
                        describe(*value.node));
  for (std::size_t i = 0; i < value.node->items.size() && value.node->kind == DocNode::Kind::list; ++i) {
    const DocRef row = value.item(i);
    if (row.node->kind != DocNode::Kind::list || row.node->items.size() != desc.count) {
      context.sink.report(Code::wrong_type, row.at(), fmt::format("a row [{}]", columns(desc)), describe(*row.node));
      continue;
    }
    for (std::size_t c = 0; c < desc.count; ++c) all.push_back(read_number(row.item(c), column_unit(desc, c), context));
  }
  param.value = std::move(all);
}

void read_vectors(const DocRef& value, const cardan_param_desc& desc, ParamValue& param, ReadContext& context) {
  if (value.node->kind != DocNode::Kind::list || (desc.count > 0 && value.node->items.size() != desc.count)) {
    const std::string count = desc.count > 0 ? fmt::format("{} ", desc.count) : "";
    context.sink.report(Code::wrong_type, value.at(), fmt::format("a list of {}vectors of 3 numbers", count), describe(*value.node));
    return;
  }
  std::vector<double> all;
  for (std::size_t i = 0; i < value.node->items.size(); ++i)
    for (double x : read_numbers(value.item(i), desc.unit, 3, context)) all.push_back(x);
  param.value = std::move(all);
}

/// "0 m^3/s^2: that of the body in DE440" where the meaning tells what 0 stands for.
std::string number_text(const cardan_param_desc& desc) {
  const std::string_view unit = desc.unit, meaning = desc.meaning, zero = " 0: ";
  std::string text = fmt::format("{:.6g}", desc.fallback[0]);
  if (unit != "1") text += fmt::format(" {}", unit);
  if (const auto at = meaning.find(zero); at != meaning.npos && desc.fallback[0] == 0.0)
    text += fmt::format(": {}", meaning.substr(at + zero.size()));
  return text;
}

void note_fallback(MapReader& map, const cardan_param_desc& desc) {
  if (desc.flags & CARDAN_REQUIRED) return;
  if (desc.kind == CARDAN_NUMBER) map.note_default(desc.name, number_text(desc));
  if (desc.kind == CARDAN_INTEGER) map.note_default(desc.name, fmt::format("{:.6g}", desc.fallback[0]));
  if (desc.kind == CARDAN_TRUTH) map.note_default(desc.name, desc.fallback[0] != 0.0 ? "true" : "false");
  if (desc.kind == CARDAN_CHOICE && desc.fallback[0] >= 0.0 && desc.fallback[0] < desc.count)
    map.note_default(desc.name, desc.names[static_cast<std::size_t>(desc.fallback[0])]);
}

/// A view of values that keeps which of them were asked for.
struct Asked {
  explicit Asked(ParamTable& table) : values(table.view()) {
    view.host = this;
    view.numbers = [](const cardan_param_values* v, const char* name, std::uint32_t* count) {
      const cardan_param_values& all = note(v, name);
      return all.numbers(&all, name, count);
    };
    view.text = [](const cardan_param_values* v, const char* name) {
      const cardan_param_values& all = note(v, name);
      return all.text(&all, name);
    };
    view.bytes = [](const cardan_param_values* v, const char* name, std::uint64_t* size) {
      const cardan_param_values& all = note(v, name);
      return all.bytes(&all, name, size);
    };
    view.fail = [](const cardan_param_values*, const char*, const char*, const char*, const char*) {};
  }
  Asked(const Asked&) = delete;
  Asked& operator=(const Asked&) = delete;

  cardan_param_values values, view = values;
  std::set<std::string, std::less<>> names;

 private:
  static const cardan_param_values& note(const cardan_param_values* v, const char* name) {
    auto& self = *static_cast<Asked*>(const_cast<void*>(v->host));
    if (name) self.names.insert(name);
    return self.values;
  }
};

std::string_view trimmed(std::string_view text) {
  const auto begin = text.find_first_not_of(" \t\r");
  return begin == text.npos ? std::string_view() : text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

/// One line of a table after the other.
class TableFile {
 public:
  TableFile(const cardan_param_desc& table, const std::string& path, const Located& at, DiagnosticSink& sink)
      : table_(table), path_(path), at_(at), sink_(sink), factors_(table.count, 0.0), place_(table.count), width_(table.count) {
    std::iota(place_.begin(), place_.end(), std::size_t{0});
  }

  void line(std::string_view text, int number) {
    if (!places_known_) return;
    if (number == 1 && text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    text = trimmed(text.substr(0, text.find('#')));
    if (text.empty()) return;
    line_ = number;
    std::vector<std::string_view> fields;
    for (std::size_t begin = 0; begin <= text.size();) {
      const std::size_t end = std::min(text.find(',', begin), text.size());
      fields.push_back(trimmed(text.substr(begin, end - begin)));
      begin = end + 1;
    }
    const bool first = std::exchange(first_, false);
    if (first &&
        std::ranges::any_of(fields, [](std::string_view f) { return !f.empty() && std::isalpha(static_cast<unsigned char>(f[0])); }))
      return void(places_known_ = read_head(fields));
    if (fields.size() != width_) {
      const std::string given = width_ == table_.count ? columns(table_) : "as many as the first line names";
      return fault(Code::wrong_type, fmt::format("{} values: {}", width_, given), fmt::format("{} values", fields.size()));
    }
    for (std::size_t i = 0; i < table_.count; ++i) read_field(fields[place_[i]], i);
  }
  std::vector<double> take() { return std::move(all_); }

 private:
  void fault(Code code, std::string expected, std::string got, std::string hint = {}) {
    sink_.report(code, {at_.key_path, {path_, line_, 0}}, std::move(expected), std::move(got), std::move(hint));
  }

  bool refuse_head(std::string got) {
    fault(Code::wrong_type, "the columns " + columns(table_), in_quotes(got),
          got.find_first_of(";\t") == std::string::npos ? "" : "commas part the columns, and a point is the decimal sign");
    return false;
  }

  /// The first line, where it names columns: those of the table in any order, among others that do not count. False where they are not
  /// there.
  bool read_head(const std::vector<std::string_view>& fields) {
    const auto name_of = [](std::string_view field) { return trimmed(field.substr(0, field.find('['))); };
    width_ = fields.size();
    for (std::size_t i = 0; i < table_.count; ++i) {
      const auto named = std::ranges::find(fields, std::string_view(table_.names[i]), name_of);
      if (named == fields.end()) return refuse_head(fmt::format("{}", fmt::join(fields, ", ")));
      place_[i] = static_cast<std::size_t>(named - fields.begin());
      const std::string_view unit = trimmed(named->substr(name_of(*named).size()));
      const auto wanted = parse_unit(column_unit(table_, i));
      const auto given = unit.size() > 2 && unit.back() == ']' ? parse_unit(unit.substr(1, unit.size() - 2)) : std::nullopt;
      if (!unit.empty() && (!given || !(given->dimension == wanted->dimension))) return refuse_head(std::string(*named));
      if (given) factors_[i] = given->factor;
    }
    return true;
  }

  void read_field(std::string_view field, std::size_t i) {
    if (factors_[i] != 0.0) {
      const auto number = parse_number(field);
      if (!number) return fault(Code::bad_number, "a number, its unit is in the first line", in_quotes(field));
      return all_.push_back(factors_[i] * *number);
    }
    const auto value = parse_quantity(field, column_unit(table_, i));
    if (const auto* wrong = std::get_if<QuantityFault>(&value)) return fault(wrong->code, wrong->expected, wrong->got, wrong->hint);
    all_.push_back(std::get<double>(value));
  }

  const cardan_param_desc& table_;
  const std::string& path_;
  const Located& at_;
  DiagnosticSink& sink_;
  std::vector<double> factors_, all_;  // of units in the first line; 0: none there
  std::vector<std::size_t> place_;     // of the columns of the table in a line
  std::size_t width_;                  // values in a line
  bool first_ = true, places_known_ = true;
  int line_ = 0;
};

}  // namespace

void read_params(MapReader& map, ParamSchema schema, ParamValues& params) {
  ReadContext& context = map.context();
  for (const cardan_param_desc& desc : schema) {
    const auto value = map.find(desc.name);
    if (!value) {
      note_fallback(map, desc);
      continue;
    }
    ParamValue param{0.0, value->at(), {}};
    switch (desc.kind) {
      case CARDAN_NUMBER:
      case CARDAN_INTEGER:
        param.value = read_number(*value, desc.unit, context);
        break;
      case CARDAN_TRUTH:
        param.value = read_flag(*value, context);
        break;
      case CARDAN_TEXT:
        param.value = read_text(*value, desc.meaning, context);
        break;
      case CARDAN_CHOICE:
        param.value = read_text(*value, fmt::format("{} ({})", one_of(choices(desc)), desc.meaning), context);
        break;
      case CARDAN_FILE:
        param.file = read_text(*value, fmt::format("the name of a file: {}", desc.meaning), context);
        param.value = beside(value->node->mark, param.file);
        break;
      case CARDAN_TABLE:
        read_rows(*value, desc, param, context);
        break;
      case CARDAN_VECTOR:
      case CARDAN_UNIT_VECTOR:
        if (takes_each(desc) && value->node->kind == DocNode::Kind::scalar)
          param.value = read_number(*value, desc.unit, context);
        else if (takes_each(desc) && (value->node->kind != DocNode::Kind::list || value->node->items.size() != 3))
          context.sink.report(Code::wrong_type, value->at(),
                              fmt::format("one number for all, or a list of 3, each: {}", expected_number(desc.unit)),
                              describe(*value->node));
        else
          param.value = read_numbers(*value, desc.unit, 3, context);
        break;
      default:
        read_vectors(*value, desc, param, context);
    }
    params.insert_or_assign(desc.name, std::move(param));
  }
}

std::optional<ParamTable> checked_params(const SystemSpec& spec, const GivenParams& given, ParamSchema schema, DiagnosticSink& sink) {
  return Checker(spec, given, schema, sink).checked();
}

void report_refused(const SystemSpec& spec, const GivenParams& given, ParamSchema schema, const ParamTable& values, Code whole,
                    DiagnosticSink& sink) {
  for (const auto& [name, expected, got, hint] : values.failures) {
    const auto desc = std::ranges::find(schema, std::string_view(name), &cardan_param_desc::name);
    const bool axes = desc != schema.end() && is_unit_kind(*desc), table = desc != schema.end() && desc->kind == CARDAN_TABLE;
    const auto numbers = values.numbers.find(name);
    const auto text = values.texts.find(name);
    std::string shown = got;
    if (shown.empty() && text != values.texts.end()) shown = in_quotes(text->second);
    if (shown.empty() && numbers != values.numbers.end())
      shown = axes    ? vectors_text(numbers->second)
              : table ? fmt::format("{} rows", numbers->second.size() / desc->count)
                      : fmt::format("{:.6g}", fmt::join(numbers->second, ", "));
    sink.report(name.empty() ? whole
                : axes       ? Code::bad_axes
                             : Code::out_of_range,
                spec.locate(name.empty() ? given.path : fmt::format("{}.{}", given.path, name)), expected,
                shown.empty() ? "nothing" : shown, hint);
  }
  if (values.failures.empty())
    sink.report(whole, spec.locate(given.path), fmt::format("parameters that {} accepts", given.what), "others, without a word why");
}

std::vector<double> pack_params(const SystemSpec& spec, const GivenParams& given, const ParamsOfFamily& family, DiagnosticSink& sink) {
  std::optional<ParamTable> values = checked_params(spec, given, family.schema, sink);
  if (!values) return {};
  std::size_t bytes = family.bytes;
  if (family.packed_size) {
    const cardan_param_values view = values->view();
    bytes = family.packed_size(&view);
  }
  std::vector<double> packed = pack(bytes, family.pack, *values);
  if (packed.empty()) report_refused(spec, given, family.schema, *values, Code::out_of_range, sink);
  return packed;
}

std::vector<std::string> keys_not_read(const SystemSpec& spec, const GivenParams& given, const ParamsOfFamily& family) {
  DiagnosticSink sink;
  std::optional<ParamTable> values = checked_params(spec, given, family.schema, sink);
  if (!values || !family.pack) return {};
  Asked asked(*values);
  const std::size_t bytes = family.packed_size ? family.packed_size(&asked.view) : family.bytes;
  std::vector<double> packed(bytes / sizeof(double) + 1, 0.0);
  if (family.pack(&asked.view, packed.data()) != 0) return {};
  std::vector<std::string> rest;
  for (const cardan_param_desc& desc : family.schema)
    if (!asked.names.contains(std::string_view(desc.name))) rest.emplace_back(desc.name);
  return rest;
}

std::string range_text(const cardan_param_desc& d) {
  if (d.lower == 0.0 && d.upper == 0.0) return {};
  const bool from = std::isfinite(d.lower), to = std::isfinite(d.upper);
  if (from && to && !(d.flags & (CARDAN_ABOVE | CARDAN_BELOW))) return fmt::format("from {:.6g} to {:.6g}", d.lower, d.upper);
  std::string out;
  if (from) out = fmt::format("{} {:.6g}", d.flags & CARDAN_ABOVE ? ">" : ">=", d.lower);
  if (to) out += fmt::format("{}{} {:.6g}", from ? " and " : "", d.flags & CARDAN_BELOW ? "<" : "<=", d.upper);
  return out;
}

std::string beside(const SourceMark& mark, const std::string& file) {
  return (std::filesystem::path(mark.file).parent_path() / file).string();
}

std::vector<double> read_table_file(const std::string& path, const cardan_param_desc& table, const Located& at, DiagnosticSink& sink) {
  std::error_code unusable;
  std::ifstream file(path);
  if (!std::filesystem::is_regular_file(path, unusable) || !file) {
    sink.report(Code::file_not_found, at, fmt::format("a CSV file that can be read, with the columns {}", columns(table)), in_quotes(path),
                "give its path relative to the vehicle file");
    return {};
  }
  if (const auto size = std::filesystem::file_size(path, unusable); size > kMostFileBytes) {
    sink.report(Code::out_of_range, at, fmt::format("a file of at most {} bytes", kMostFileBytes), fmt::format("{} bytes", size));
    return {};
  }
  TableFile rows(table, path, at, sink);
  int number = 0;
  for (std::string line; std::getline(file, line) && !sink.full();) rows.line(line, ++number);
  return rows.take();
}

}  // namespace cardan
