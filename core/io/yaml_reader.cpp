#include "core/io/yaml_reader.hpp"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <sstream>
#include <system_error>
#include <unordered_map>

#include "core/base/units.hpp"
#include "core/base/utf8.hpp"
#include "core/model/vehicle.hpp"

namespace cardan {
namespace {

constexpr std::size_t kMostBytes = 16u << 20;  // of one file
constexpr std::size_t kMostNodes = 1'000'000;  // also after aliases: an alias of aliases grows without bound
constexpr std::size_t kMostMarks = 2'500'000;  // yaml-cpp holds all tokens of a [...] or {...} at once, 150 bytes each
constexpr std::size_t kLongestKey = 1024;      // as YAML has it for a key without `?`
constexpr int kDeepest = 64;
constexpr std::string_view kMarks = ",[]{}:?\"'&*!";
constexpr const char* kNesting = "at most 64 levels";

[[noreturn]] void fail(Code code, SourceMark mark, std::string expected, std::string got, std::string hint = {}) {
  refuse(code, {"", std::move(mark)}, std::move(expected), std::move(got), std::move(hint));
}

/// yaml-cpp counts from zero, and knows no place (-1) of nodes that it made itself.
SourceMark mark_of(const YAML::Mark& mark, const std::string& file) { return {file, mark.line + 1, mark.column + 1}; }

SourceMark mark_of_byte(std::string_view text, std::size_t byte, const std::string& file) {
  const std::string_view before = text.substr(0, byte);
  const std::size_t line_start = before.rfind('\n') + 1;  // npos + 1 = 0
  return {file, static_cast<int>(std::ranges::count(before, '\n')) + 1, static_cast<int>(byte - line_start) + 1};
}

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
  if (message.find("flow not found") != std::string::npos) return "a bracket opened before this place is not closed, or a comma is missing";
  if (message == "illegal map value") return "look at the indentation, and for a `:` inside of a text that is not quoted";
  return {};
}

/// What the parser of yaml-cpp tells, kept as a flat tree within bounds: the first value too many, the first nesting too
/// deep and the first thing after the document end the parsing, whatever else the text holds.
class Tree : public YAML::EventHandler {
 public:
  using Kind = DocNode::Kind;
  struct Node {
    Kind kind = Kind::empty;
    bool flow = false;
    int line = 0, column = 0;
    int alias_of = -1, first = -1, next = -1;  // indices of nodes: what an alias stands for, first child, next sibling
    std::string text;
  };

  Tree(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  /// The nodes; the first is the root. Empty where there is no document.
  const std::vector<Node>& nodes() const { return nodes_; }
  /// Where the last text in quotes began (its anchor, if it has one).
  std::size_t last_in_quotes() const { return last_in_quotes_; }

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++documents_ == 1) return;
    const std::string_view rest = text_.substr(std::min(static_cast<std::size_t>(mark.pos), text_.size()));
    fail(Code::yaml_syntax, mark_of(mark, file_), "one document",
         rest.starts_with("---") ? "another one, divided by `---`"
                                 : "more after its end: " + in_quotes(std::string(rest.substr(0, rest.find_first_of("\r\n")))));
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { add(Kind::empty, mark, "", anchor); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    nodes_[add(Kind::empty, mark, "", 0)].alias_of = anchors_.at(anchor);
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor, const std::string& value) override {
    nodes_[add(Kind::scalar, mark, tag, anchor)].text = value;
    if (tag == "!") last_in_quotes_ = static_cast<std::size_t>(mark.pos);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor, YAML::EmitterStyle::value style) override {
    open(add(Kind::list, mark, tag, anchor), style);
  }
  void OnSequenceEnd() override { open_.pop_back(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor, YAML::EmitterStyle::value style) override {
    open(add(Kind::map, mark, tag, anchor), style);
  }
  void OnMapEnd() override { open_.pop_back(); }

 private:
  struct Open {
    int node, last;
  };

  std::size_t add(Kind kind, const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor) {
    const SourceMark at = mark_of(mark, file_);
    if (nodes_.size() == kMostNodes) fail(Code::yaml_syntax, at, fmt::format("at most {} values", kMostNodes), "more");
    if (open_.size() > kDeepest) fail(Code::yaml_syntax, at, kNesting, "deeper nesting");
    if (!tag.empty() && tag != "?" && tag != "!") fail(Code::yaml_syntax, at, "a value without a tag", in_quotes(tag));
    const int index = static_cast<int>(nodes_.size());
    Node node;
    node.kind = kind;
    node.line = at.line;
    node.column = at.column;
    nodes_.push_back(std::move(node));
    if (!open_.empty()) {
      Open& around = open_.back();
      (around.last < 0 ? at_index(around.node).first : at_index(around.last).next) = index;
      around.last = index;
    }
    if (anchor != YAML::NullAnchor) anchors_[anchor] = index;
    return nodes_.size() - 1;
  }
  void open(std::size_t index, YAML::EmitterStyle::value style) {
    nodes_[index].flow = style == YAML::EmitterStyle::Flow;
    open_.push_back({static_cast<int>(index), -1});
  }
  Node& at_index(int i) { return nodes_[static_cast<std::size_t>(i)]; }

  std::string_view text_;
  const std::string& file_;
  std::vector<Node> nodes_;
  std::vector<Open> open_;
  std::unordered_map<YAML::anchor_t, int> anchors_;
  std::size_t last_in_quotes_ = std::string_view::npos;
  int documents_ = 0;
};

/// The document of a tree: aliases are copies, within bounds of their own.
class Converter {
 public:
  Converter(const std::vector<Tree::Node>& nodes, const std::string& file, DiagnosticSink& sink)
      : nodes_(nodes), file_(file), sink_(sink) {}

  DocNode convert(int index, const SourceMark& key_mark, int depth) {
    const Tree::Node& node = resolved(index);
    DocNode out;
    out.kind = node.kind;
    const bool on_a_later_line = node.kind != DocNode::Kind::scalar && !node.flow;
    out.mark = on_a_later_line ? key_mark : mark_of(node);
    if (depth > kDeepest) fail(Code::yaml_syntax, mark_of(node), kNesting, "deeper nesting, or an alias of itself");
    bytes_ += node.text.size();
    if (++count_ > kMostNodes || bytes_ > kMostBytes)
      fail(Code::yaml_syntax, mark_of(node), fmt::format("at most {} values and {} MiB of text", kMostNodes, kMostBytes >> 20),
           "more, counting aliases");
    out.text = node.text;
    if (node.kind == DocNode::Kind::list) {
      for (int i = node.first; i >= 0; i = next(i)) {
        path_.push_back(fmt::format("[{}]", out.items.size()));
        out.items.push_back(convert(i, mark_of(resolved(i)), depth + 1));
        path_.pop_back();
      }
    } else if (node.kind == DocNode::Kind::map) {
      add_entries(out, node, depth);
    }
    return out;
  }

 private:
  const Tree::Node& at(int i) const { return nodes_[static_cast<std::size_t>(i)]; }
  int next(int i) const { return at(i).next; }
  const Tree::Node& resolved(int i) const { return at(i).alias_of < 0 ? at(i) : at(at(i).alias_of); }
  SourceMark mark_of(const Tree::Node& node) const { return {file_, node.line, node.column}; }

  void add_entries(DocNode& map, const Tree::Node& node, int depth) {
    std::unordered_map<std::string_view, int> first_line;
    for (int i = node.first; i >= 0; i = next(next(i))) {
      const SourceMark mark = mark_of(resolved(i));
      if (resolved(i).kind != DocNode::Kind::scalar) fail(Code::yaml_syntax, mark, "a key that is one word", "a list, a map or nothing");
      const std::string& key = resolved(i).text;
      bytes_ += key.size();
      if (key.size() > kLongestKey)
        fail(Code::yaml_syntax, mark, fmt::format("a key of at most {} bytes", kLongestKey), fmt::format("{} bytes", key.size()));
      if (key == "<<")
        fail(Code::yaml_syntax, mark, "a key", "a merge key `<<`", "write the keys out; whole values may be repeated by &name and *name");
      path_.push_back(path_.empty() ? key : "." + key);
      if (const auto [first, is_new] = first_line.emplace(key, mark.line); is_new) {
        map.items.push_back(convert(next(i), mark, depth + 1));
        map.keys.push_back({key, mark});
      } else {
        sink_.report(Code::duplicate_key, {fmt::format("{}", fmt::join(path_, "")), mark}, "each key once",
                     fmt::format("{} again; first on line {}", in_quotes(key), first->second));
      }
      path_.pop_back();
    }
  }

  const std::vector<Tree::Node>& nodes_;
  const std::string& file_;
  DiagnosticSink& sink_;
  std::vector<std::string> path_;  // of the key that is read
  std::size_t count_ = 0, bytes_ = 0;
};

/// yaml-cpp takes a text in quotes for closed where the file ends with a line break: whether that at `from` is.
bool is_closed(std::string_view text, std::size_t from) {
  from = text.find_first_of("'\"|>", from);  // after its anchor
  if (from == std::string_view::npos || text[from] == '|' || text[from] == '>') return true;
  for (std::size_t i = from + 1; i < text.size(); ++i) {
    if (text[from] == '"' && text[i] == '\\')
      ++i;
    else if (text[i] == text[from] && text[from] == '\'' && i + 1 < text.size() && text[i + 1] == '\'')
      ++i;
    else if (text[i] == text[from])
      return true;
  }
  return false;
}

/// "bodies.bus.com[2]" -> bodies, bus, com, 2. Empty for what is no such path.
std::vector<std::string> split_path(std::string_view path) {
  std::vector<std::string> parts(1);
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (path[i] == '.') {
      parts.emplace_back();
    } else if (path[i] == '[') {
      const std::size_t end = path.find(']', i);
      const bool closed = end != std::string_view::npos && (end + 1 == path.size() || path[end + 1] == '.' || path[end + 1] == '[');
      if (!closed) return {};
      parts.emplace_back(path.substr(i + 1, end - i - 1));
      i = end;
    } else {
      parts.back() += path[i];
    }
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
  if (const auto marks = std::ranges::count_if(text, [](char c) { return kMarks.find(c) != std::string_view::npos; });
      marks > static_cast<std::ptrdiff_t>(kMostMarks))
    fail(Code::yaml_syntax, {file, 0, 0}, fmt::format("at most {} of the characters {}", kMostMarks, kMarks), fmt::format("{}", marks));
  DiagnosticSink sink;
  try {
    std::istringstream stream{std::string(text)};
    YAML::Parser parser(stream);
    Tree tree(text, file);
    while (parser.HandleNextDocument(tree)) {
    }
    if (tree.last_in_quotes() < text.size() && !is_closed(text, tree.last_in_quotes()))
      fail(Code::yaml_syntax, mark_of_byte(text, tree.last_in_quotes(), file), "a closing quote", "the end of the file");
    if (tree.nodes().empty() || tree.nodes()[0].kind == DocNode::Kind::empty)
      return DocNode{DocNode::Kind::empty, {}, {}, {}, {file, 0, 0}};
    DocNode root = Converter(tree.nodes(), file, sink).convert(0, {file, 1, 1}, 0);
    sink.throw_if_any();
    return root;
  } catch (const YAML::Exception& e) {
    fail(Code::yaml_syntax, mark_of(e.mark, file), "YAML", e.msg, hint_for(e.msg, text.find('\t') != std::string_view::npos));
  }
}

std::string read_text_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string text;
  char block[1 << 16];
  while (text.size() <= kMostBytes && (in.read(block, sizeof block) || in.gcount() > 0))
    text.append(block, static_cast<std::size_t>(in.gcount()));
  if (!in.eof() && text.size() <= kMostBytes)
    fail(Code::file_not_found, {path, 0, 0}, "a file that can be read", std::error_code(errno, std::generic_category()).message());
  return text;
}

SourceMark setting_mark(std::string_view key_path, std::string_view value) { return {fmt::format("--set {}={}", key_path, value), 0, 0}; }

void apply_override(DocNode& root, std::string_view key_path, std::string_view value) {
  const SourceMark mark = setting_mark(key_path, value);
  DocNode* node = &root;
  std::string path;
  bool named_by_users = false;  // the keys of this map are names of bodies or nodes
  const std::vector<std::string> parts = split_path(key_path);
  if (parts.empty())
    refuse(Code::unknown_key, {std::string(key_path), mark}, "names divided by points, and [index]", in_quotes(std::string(key_path)));
  for (const std::string& part : parts) {
    const std::string around = path;
    path += node->kind == DocNode::Kind::list ? fmt::format("[{}]", part) : fmt::format("{}{}", path.empty() ? "" : ".", part);
    const auto refuse = [&](std::string expected, std::string hint) {
      cardan::refuse(Code::unknown_key, {path, mark}, std::move(expected), in_quotes(part), std::move(hint));
    };
    if (node->kind == DocNode::Kind::list) {
      std::size_t index = 0;
      const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), index);
      if (error != std::errc{} || end != part.data() + part.size() || index >= node->items.size())
        refuse(fmt::format("an index below {}", node->items.size()), "");
      node = &node->items[index];
      continue;
    }
    if (node->kind == DocNode::Kind::scalar) refuse(fmt::format("{} itself: it is one value", around), "");
    if (node->kind == DocNode::Kind::empty && !part.empty() && part.find_first_not_of("0123456789") == std::string::npos) {
      path = fmt::format("{}[{}]", around, part);
      refuse("an entry of a list that the file has", fmt::format("give all of it: {}=[...]", around));
    }
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

SystemSpec vehicle_from_text(std::string_view text, const std::string& file, const Registry& registry, const Overrides& overrides,
                             const SystemSpec* described) {
  DocNode root = parse_yaml(text, file);
  if (root.kind == DocNode::Kind::empty) fail(Code::empty_system, {file, 0, 0}, "a vehicle", "an empty file");
  if (root.kind == DocNode::Kind::map)  // what else it is is answered as in a file without overrides
    for (const auto& [key_path, value] : overrides) apply_override(root, key_path, value);
  DiagnosticSink sink;
  SystemSpec spec = vehicle_from_doc(root, registry, sink, described);
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
