#include "core/io/yaml_reader.hpp"

#include <fmt/format.h>
#include <yaml-cpp/depthguard.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <system_error>
#include <unordered_map>

#include "core/base/units.hpp"
#include "core/base/utf8.hpp"
#include "core/model/vehicle.hpp"

namespace cardan {
namespace {

constexpr std::size_t kMostBytes = 16u << 20;  // of one file
constexpr std::size_t kMostNodes = 1'000'000;  // after aliases: an alias of aliases grows without bound
constexpr int kDeepest = 64;
constexpr const char* kNesting = "at most 64 levels";

[[noreturn]] void fail(Code code, SourceMark mark, std::string expected, std::string got, std::string hint = {}) {
  throw InputError(
      Diagnostic{code, {"", std::move(mark)}, std::move(expected), std::move(got), std::move(hint), {}, {}, 0});
}

/// yaml-cpp counts from zero, and knows no place (-1) of nodes that it made itself.
SourceMark mark_of(const YAML::Mark& mark, const std::string& file) { return {file, mark.line + 1, mark.column + 1}; }

/// Line and column of the first byte that is not part of UTF-8 text, or line 0.
SourceMark first_bad_byte(std::string_view text, const std::string& file) {
  SourceMark mark{file, 1, 1};
  while (!text.empty()) {
    const std::size_t length = utf8_character(text);
    const auto c = static_cast<unsigned char>(text[0]);
    if (length == 0 || c == 0x7F || (c < 0x20 && c != '\n' && c != '\r' && c != '\t')) return mark;
    mark.column += static_cast<int>(length);
    if (c == '\n') mark = {file, mark.line + 1, 1};
    text.remove_prefix(length);
  }
  return {file, 0, 0};
}

/// What helps with the terse messages of yaml-cpp.
std::string hint_for(const std::string& message, bool has_tab) {
  if (has_tab) return "indent with spaces: there is a tab in this file";
  if (message.find("flow not found") != std::string::npos)
    return "a bracket opened before this place is not closed, or a comma is missing";
  if (message == "illegal map value")
    return "look at the indentation, and for a `:` inside of a text that is not quoted";
  return {};
}

class Converter {
 public:
  Converter(const std::string& file, DiagnosticSink& sink) : file_(file), sink_(sink) {}

  DocNode convert(const YAML::Node& node, const std::string& path, const SourceMark& key_mark, int depth) {
    DocNode out;
    const SourceMark own = mark_of(node.Mark(), file_);
    out.mark = own.line > 0 ? own : key_mark;
    if (depth > kDeepest) fail(Code::yaml_syntax, out.mark, kNesting, "deeper nesting, or an alias of itself");
    if (++count_ > kMostNodes)
      fail(Code::yaml_syntax, out.mark, fmt::format("at most {} values", kMostNodes), "more, counting aliases");
    const std::string& tag = node.Tag();
    if (!tag.empty() && tag != "?" && tag != "!")
      fail(Code::yaml_syntax, out.mark, "a value without a tag", in_quotes(tag));
    switch (node.Type()) {
      case YAML::NodeType::Scalar:
        out.kind = DocNode::Kind::scalar;
        out.text = node.Scalar();
        break;
      case YAML::NodeType::Sequence:
        out.kind = DocNode::Kind::list;
        if (node.Style() != YAML::EmitterStyle::Flow) out.mark = key_mark;
        for (const YAML::Node& item : node)
          out.items.push_back(
              convert(item, fmt::format("{}[{}]", path, out.items.size()), mark_of(item.Mark(), file_), depth + 1));
        break;
      case YAML::NodeType::Map:
        out.kind = DocNode::Kind::map;
        if (node.Style() != YAML::EmitterStyle::Flow) out.mark = key_mark;
        add_entries(out, node, path, depth);
        break;
      default:
        out.mark = key_mark;
    }
    return out;
  }

 private:
  void add_entries(DocNode& map, const YAML::Node& node, const std::string& path, int depth) {
    std::unordered_map<std::string, int> first_line;
    for (const auto& entry : node) {
      const SourceMark mark = mark_of(entry.first.Mark(), file_);
      if (!entry.first.IsScalar()) fail(Code::yaml_syntax, mark, "a key that is one word", "a list, a map or nothing");
      const std::string& key = entry.first.Scalar();
      const std::string key_path = path.empty() ? key : fmt::format("{}.{}", path, key);
      if (key == "<<")
        fail(Code::yaml_syntax, mark, "a key", "a merge key `<<`",
             "write the keys out; whole values may be repeated by &name and *name");
      if (const auto [first, is_new] = first_line.emplace(key, mark.line); !is_new) {
        sink_.report(Code::duplicate_key, {key_path, mark}, "each key once",
                     fmt::format("{} again; first on line {}", in_quotes(key), first->second));
        continue;
      }
      map.items.push_back(convert(entry.second, key_path, mark, depth + 1));
      map.keys.push_back({key, mark});
    }
  }

  const std::string& file_;
  DiagnosticSink& sink_;
  std::size_t count_ = 0;
};

/// "bodies.bus.com[2]" -> bodies, bus, com, 2
std::vector<std::string> split_path(std::string_view path) {
  std::vector<std::string> parts(1);
  for (char c : path) {
    if (c == '.' || c == '[')
      parts.emplace_back();
    else if (c != ']')
      parts.back() += c;
  }
  return parts;
}

void set_marks(DocNode& node, const SourceMark& mark) {
  node.mark = mark;
  for (DocKey& key : node.keys) key.mark = mark;
  for (DocNode& item : node.items) set_marks(item, mark);
}

}  // namespace

DocNode parse_yaml(std::string_view text, const std::string& file) {
  if (text.size() > kMostBytes)
    fail(Code::yaml_syntax, {file, 0, 0}, fmt::format("at most {} MiB of text", kMostBytes >> 20),
         fmt::format("{} MiB", text.size() >> 20));
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (const SourceMark bad = first_bad_byte(text, file); bad.line > 0)
    fail(Code::yaml_syntax, bad, "text in UTF-8", "a byte that is not text", "is this a YAML file?");
  DiagnosticSink sink;
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(std::string(text));
    if (documents.size() > 1)
      fail(Code::yaml_syntax, mark_of(documents[1].Mark(), file), "one document",
           fmt::format("{} documents, divided by `---`", documents.size()));
    if (documents.empty() || documents[0].IsNull()) return DocNode{DocNode::Kind::empty, {}, {}, {}, {file, 0, 0}};
    DocNode root = Converter(file, sink).convert(documents[0], "", {file, 1, 1}, 0);
    sink.throw_if_any();
    return root;
  } catch (const YAML::DeepRecursion& e) {
    fail(Code::yaml_syntax, mark_of(e.mark, file), kNesting, "deeper nesting");
  } catch (const YAML::Exception& e) {
    fail(Code::yaml_syntax, mark_of(e.mark, file), "YAML", e.msg,
         hint_for(e.msg, text.find('\t') != std::string_view::npos));
  }
}

std::string read_text_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string text;
  char block[1 << 16];
  while (in.read(block, sizeof block) || in.gcount() > 0) text.append(block, static_cast<std::size_t>(in.gcount()));
  if (!in.eof())
    fail(Code::file_not_found, {path, 0, 0}, "a file that can be read",
         std::error_code(errno, std::generic_category()).message());
  return text;
}

void apply_override(DocNode& root, std::string_view key_path, std::string_view value) {
  const SourceMark mark{fmt::format("--set {}={}", key_path, value), 0, 0};
  DocNode* node = &root;
  std::string path;
  bool named_by_users = false;  // the keys of this map are names of bodies or nodes
  for (const std::string& part : split_path(key_path)) {
    const std::string around = path;
    path += node->kind == DocNode::Kind::list ? fmt::format("[{}]", part)
                                              : fmt::format("{}{}", path.empty() ? "" : ".", part);
    const auto refuse = [&](std::string expected, std::string hint) {
      throw InputError(Diagnostic{
          Code::unknown_key, {path, mark}, std::move(expected), in_quotes(part), std::move(hint), {}, {}, 0});
    };
    if (node->kind == DocNode::Kind::list) {
      std::size_t index = node->items.size();
      std::from_chars(part.data(), part.data() + part.size(), index);
      if (index >= node->items.size()) refuse(fmt::format("an index below {}", node->items.size()), "");
      node = &node->items[index];
      continue;
    }
    if (node->kind == DocNode::Kind::scalar) refuse(fmt::format("{} itself: it is one value", around), "");
    node->kind = DocNode::Kind::map;
    auto found = std::find_if(node->keys.begin(), node->keys.end(), [&](const DocKey& k) { return k.name == part; });
    if (found == node->keys.end()) {
      std::vector<std::string> legal;
      for (const DocKey& key : node->keys) legal.push_back(key.name);
      if (named_by_users) refuse(fmt::format("a name in {}: {}", around, one_of(legal)), did_you_mean(part, legal));
      node->keys.push_back({part, mark});
      node->items.push_back({DocNode::Kind::empty, {}, {}, {}, mark});
      found = node->keys.end() - 1;
    }
    node = &node->items[static_cast<std::size_t>(found - node->keys.begin())];
    named_by_users = around.empty() ? part == "bodies" : part == "nodes";
  }
  *node = parse_yaml(value, mark.file);
  set_marks(*node, mark);
}

SystemSpec vehicle_from_text(std::string_view text, const std::string& file, const Registry& registry,
                             const Overrides& overrides) {
  DocNode root = parse_yaml(text, file);
  if (root.kind == DocNode::Kind::empty) fail(Code::empty_system, {file, 0, 0}, "a vehicle", "an empty file");
  for (const auto& [key_path, value] : overrides) apply_override(root, key_path, value);
  DiagnosticSink sink;
  SystemSpec spec = vehicle_from_doc(root, registry, sink);
  if (!sink.empty()) {
    std::vector<Diagnostic> all = sink.all();
    std::stable_sort(all.begin(), all.end(), [](const Diagnostic& a, const Diagnostic& b) {
      return std::pair(a.at.mark.line, a.at.mark.column) < std::pair(b.at.mark.line, b.at.mark.column);
    });
    throw InputError(std::move(all));
  }
  spec.source_text = std::string(text);
  return spec;
}

SystemSpec read_vehicle(const std::string& path, const Registry& registry, const Overrides& overrides) {
  return vehicle_from_text(read_text_file(path), path, registry, overrides);
}

}  // namespace cardan
