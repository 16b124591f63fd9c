#include "scripts/lua/reference.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <sstream>
#include <utility>

namespace cardan {
namespace {

constexpr std::size_t kWidth = 100;  // of lines

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\r')) text.remove_suffix(1);
  return text;
}

/// The first word, brackets kept together; what follows stays in `text`. A type goes on behind a colon: fun(t: number): number.
std::string take_word(std::string_view& text) {
  text = trimmed(text);
  int depth = 0;
  std::size_t end = 0;
  for (; end < text.size(); ++end) {
    const char c = text[end];
    depth += c == '(' || c == '{' || c == '[' || c == '<' ? 1 : c == ')' || c == '}' || c == ']' || c == '>' ? -1 : 0;
    if (depth <= 0 && (c == ' ' || c == ',') && !(end > 0 && text[end - 1] == ':' && c == ' ')) break;
  }
  const std::string word(text.substr(0, end));
  text = trimmed(text.substr(end));
  return word;
}

/// "name? type text"
ApiValue value_of(std::string_view text) {
  ApiValue v;
  v.name = take_word(text);
  if (v.name.ends_with('?')) v.name.pop_back(), v.optional = true;
  v.type = take_word(text);
  v.text = text;
  return v;
}

/// "number x, number y [m] world axes": the text is of the last.
std::vector<ApiValue> results_of(std::string_view text) {
  std::vector<ApiValue> all;
  for (bool more = true; more && !trimmed(text).empty();) {
    ApiValue v;
    v.type = take_word(text);
    v.name = take_word(text);
    more = text.starts_with(',');
    if (more)
      text.remove_prefix(1);
    else
      v.text = text;
    all.push_back(std::move(v));
  }
  return all;
}

/// Lines of at most kWidth characters, each after `indent`; the first one begins at column `first`.
std::string wrapped(std::string_view text, const std::string& indent, std::size_t first) {
  std::string out, line;
  std::size_t used = first;
  std::istringstream words{std::string(text)};
  for (std::string word; words >> word;) {
    if (used + word.size() + 1 > kWidth && used > indent.size()) {
      out += line + "\n" + indent;
      line.clear();
      used = indent.size();
    }
    line += (line.empty() ? "" : " ") + word;
    used += word.size() + 1;
  }
  return out + line;
}

/// Lines "name  type  text" with columns.
std::string listed(const std::vector<ApiValue>& values, const std::string& indent) {
  constexpr std::size_t kWidest = 24;  // of a type
  std::size_t names = 0, types = 0;
  const auto name = [](const ApiValue& v) { return v.name + (v.optional ? "?" : ""); };
  for (const ApiValue& v : values) {
    names = std::max(names, name(v).size());
    if (v.type.size() <= kWidest) types = std::max(types, v.type.size());
  }
  std::string out;
  for (const ApiValue& v : values) {
    std::string line = fmt::format("{}{:<{}}  {:<{}}", indent, name(v), names, v.type, types);
    const std::string deeper(indent.size() + names + types + 4, ' ');
    if (!v.text.empty()) line += "  " + wrapped(v.text, deeper, line.size() + 2);
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
  return out;
}

bool is_key(const std::string& name) { return !name.empty() && name.front() != '['; }

}  // namespace

std::string ApiFunction::signature() const {
  std::string out = owner.empty() ? name : lower(owner) + joint + name, list;
  for (const ApiValue& p : parameters) list += (list.empty() ? "" : ", ") + (p.optional ? "[" + p.name + "]" : p.name);
  return out + "(" + list + ")";
}

std::string ApiFunction::summary() const {
  const std::size_t end = text.find(". ");
  std::string out = text.substr(0, std::min(end, text.find('\n')));
  if (out.ends_with('.')) out.pop_back();
  return out;
}

ApiReference::ApiReference(const std::vector<std::string>& files) {
  for (const std::string& file : files) {
    std::string doc, module;
    std::vector<ApiValue> parameters, results;
    ApiClass* open = nullptr;  // whose fields are being listed
    const auto forget = [&] { doc.clear(), parameters.clear(), results.clear(); };
    std::istringstream lines(file);
    for (std::string line; std::getline(lines, line);) {
      std::string_view text = trimmed(line);
      const auto starts = [&](std::string_view with) {
        if (!text.starts_with(with)) return false;
        text = trimmed(text.substr(with.size()));
        return true;
      };
      if (starts("---@class ")) {
        const std::size_t colon = text.find(':');
        const std::string name(trimmed(text.substr(0, colon)));
        open = &classes_[name];
        open->name = name;
        open->text = std::exchange(doc, {});
        if (colon != std::string_view::npos) open->parent = trimmed(text.substr(colon + 1));
      } else if (starts("---@field ")) {
        if (open) open->fields.push_back(value_of(text));
      } else if (starts("---@param ")) {
        parameters.push_back(value_of(text));
      } else if (starts("---@return ")) {
        for (ApiValue& v : results_of(text)) results.push_back(std::move(v));
      } else if (open && starts("---@overload fun(")) {  // an object that is called
        ApiFunction f;
        f.name = lower(open->name);
        f.text = open->text;
        text = text.substr(0, text.rfind(')'));
        const std::size_t colon = text.find(':');
        f.parameters.push_back(
            {std::string(text.substr(0, colon)), std::string(trimmed(text.substr(std::min(text.size(), colon + 1)))), {}, false});
        functions_.push_back(std::move(f));
      } else if (starts("---@")) {
        continue;
      } else if (starts("---")) {
        doc += (doc.empty() ? "" : " ") + std::string(text);
      } else if (starts("function ")) {
        const std::size_t bracket = text.find('('), end = text.find(')');
        if (bracket == std::string_view::npos || end == std::string_view::npos) continue;
        ApiFunction f;
        std::string_view whole = text.substr(0, bracket);
        if (const std::size_t joint = whole.find_first_of(".:"); joint != std::string_view::npos) {
          f.owner = whole.substr(0, joint);
          f.joint = whole[joint];
          whole = whole.substr(joint + 1);
        }
        f.name = whole;
        f.text = std::exchange(doc, {});
        f.parameters = std::exchange(parameters, {});
        f.results = std::exchange(results, {});
        std::vector<ApiValue> all;  // in the order of the declaration, with those that nothing is said about
        std::string_view list = text.substr(bracket + 1, end - bracket - 1);
        while (!trimmed(list).empty()) {
          const std::string name = take_word(list);
          if (list.starts_with(',')) list.remove_prefix(1);
          const auto known = std::find_if(f.parameters.begin(), f.parameters.end(), [&](const ApiValue& v) { return v.name == name; });
          all.push_back(known != f.parameters.end() ? *known : ApiValue{name, {}, {}, false});
        }
        f.parameters = std::move(all);
        if (f.owner == "sim") f.owner = "Sim";
        if (f.owner.empty()) {
          functions_.push_back(std::move(f));
        } else {
          ApiClass& c = classes_[find_class(f.owner) ? find_class(f.owner)->name : f.owner];
          if (c.name.empty()) c.name = f.owner;
          f.owner = c.name;
          c.functions.push_back(std::move(f));
        }
      } else if (const std::size_t equals = text.find(" = "); equals != std::string_view::npos && text.find('.') < equals) {
        const std::string left(text.substr(0, equals)), right(trimmed(text.substr(equals + 3)));  // Hinge.angle = Hinge.q
        const std::size_t dot = left.find('.'), from = right.find('.');
        const auto c = classes_.find(left.substr(0, dot));
        if (c == classes_.end() || from == std::string::npos) continue;
        const auto same = std::find_if(c->second.functions.begin(), c->second.functions.end(),
                                       [&](const ApiFunction& f) { return f.name == right.substr(from + 1); });
        if (same == c->second.functions.end()) continue;
        ApiFunction alias = *same;
        alias.name = left.substr(dot + 1);
        c->second.functions.push_back(std::move(alias));
      } else if (text.starts_with("local ") && text.ends_with(" = {}") && !doc.empty()) {  // a module
        const std::string name(text.substr(6, text.size() - 11));
        ApiClass& c = classes_[name];
        c.name = name;
        c.text = std::exchange(doc, {});
      } else {
        if (text.empty()) open = nullptr;
        forget();
      }
    }
  }
}

const ApiClass* ApiReference::find_class(std::string_view name) const {
  for (const auto& [key, c] : classes_)
    if (lower(key) == lower(name)) return &c;
  return nullptr;
}

std::vector<const ApiFunction*> ApiReference::functions_of(const ApiClass& c) const {
  std::vector<const ApiFunction*> out;
  for (const ApiClass* at = &c; at; at = at->parent.empty() ? nullptr : find_class(at->parent))
    for (const ApiFunction& f : at->functions) out.push_back(&f);
  return out;
}

std::vector<const ApiFunction*> ApiReference::find(std::string_view name) const {
  std::vector<const ApiFunction*> out;
  const std::size_t joint = name.find_first_of(".:");
  if (joint != std::string_view::npos) {
    const ApiClass* c = find_class(name.substr(0, joint));
    if (c)
      for (const ApiFunction* f : functions_of(*c))
        if (f->name == name.substr(joint + 1)) out.push_back(f);
    return out;
  }
  for (const ApiFunction& f : functions_)
    if (f.name == name) out.push_back(&f);
  for (const auto& [key, c] : classes_)
    for (const ApiFunction& f : c.functions)
      if (f.name == name) out.push_back(&f);
  return out;
}

std::vector<std::string> ApiReference::topics() const {
  std::vector<std::string> out;
  for (const ApiFunction& f : functions_) out.push_back(f.name);
  for (const auto& [key, c] : classes_) {
    if (!c.functions.empty()) out.push_back(lower(key));
    for (const ApiFunction& f : c.functions) out.push_back(f.name);
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

/// The keys of a table that is a class of the reference without functions; of an array of them too.
std::string ApiReference::fields_text(std::string_view type, const std::string& indent) const {
  if (type.ends_with("[]")) type.remove_suffix(2);
  if (type.starts_with("table<string, ") && type.ends_with('>')) type = type.substr(14, type.size() - 15);
  const auto c = classes_.find(std::string(type));
  if (c == classes_.end() || c->second.fields.empty() || !c->second.functions.empty()) return {};
  std::string out = fmt::format("{}{}\n", indent, type) + listed(c->second.fields, indent + "  ");
  for (const ApiValue& f : c->second.fields) out += fields_text(f.type, indent);
  return out;
}

std::string ApiReference::text_of(const ApiFunction& f) const {
  std::string out = f.signature() + "\n";
  if (!f.text.empty()) out += "  " + wrapped(f.text, "  ", 2) + "\n";
  if (!f.parameters.empty()) out += "\n" + listed(f.parameters, "  ");
  if (!f.results.empty()) {
    std::vector<ApiValue> results = f.results;
    for (ApiValue& r : results)
      if (r.name.empty()) r.name = "result";
    out += "\nreturns\n" + listed(results, "  ");
  }
  for (const auto* list : {&f.parameters, &f.results})
    for (const ApiValue& v : *list)
      if (const std::string fields = fields_text(v.type, ""); !fields.empty()) out += "\n" + fields;
  out.pop_back();
  return out;
}

std::string ApiReference::text_of(const ApiClass& c) const {
  std::string out = lower(c.name);
  if (!c.text.empty()) out += ": " + wrapped(c.text, "  ", out.size() + 2);
  std::vector<ApiValue> fields;
  std::copy_if(c.fields.begin(), c.fields.end(), std::back_inserter(fields), [](const ApiValue& v) { return is_key(v.name); });
  if (!fields.empty()) out += "\n\n" + listed(fields, "  ");
  const std::vector<const ApiFunction*> all = functions_of(c);
  std::size_t width = 0;
  const auto signature = [&](const ApiFunction& f) {  // inherited ones as those of this class
    ApiFunction own = f;
    own.owner = c.name;
    return own.signature();
  };
  for (const ApiFunction* f : all) width = std::max(width, std::min<std::size_t>(signature(*f).size(), 40));
  if (!all.empty()) out += out.ends_with('\n') ? "\n" : "\n\n";
  for (const ApiFunction* f : all) {
    std::string line = fmt::format("  {:<{}}", signature(*f), width);
    std::string what = f->summary();
    if (what.empty() && !f->results.empty()) what = fmt::format("{} {}", f->results[0].type, f->results[0].text);
    line += "  " + wrapped(what, std::string(width + 4, ' '), line.size() + 2);
    out += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  if (out.ends_with('\n')) out.pop_back();
  return out;
}

std::string ApiReference::overview() const {
  std::string out = "help(x) tells about an object or a function, help \"name\" about a name:\n\n";
  std::size_t width = 0;
  for (const ApiFunction& f : functions_) width = std::max(width, f.signature().size());
  const auto line = [&](const std::string& left, const std::string& right) {
    out += fmt::format("  {:<{}}  {}\n", left, width, wrapped(right, std::string(width + 4, ' '), width + 4));
  };
  for (const ApiFunction& f : functions_) line(f.signature(), f.summary());
  out += "\n";
  for (const auto& [key, c] : classes_) {
    ApiFunction first;  // its first sentence
    first.text = c.text;
    if (!c.functions.empty()) line(lower(key), first.summary());
  }
  out.pop_back();
  return out;
}

}  // namespace cardan
