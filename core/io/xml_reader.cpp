#include "core/io/xml_reader.hpp"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <algorithm>
#include <functional>

#include "core/base/units.hpp"
#include "core/base/utf8.hpp"

namespace cardan {
namespace {

constexpr std::size_t kMostBytes = 16u << 20, kMostElements = 200'000, kMostAttributes = 100, kMostName = 60;
constexpr int kMostLevels = 95;  // of elements; tinyxml2 gives up at 100

/// The bounds are kept before the parser sees the text: it compares each attribute of an element with those before it.
class BeforeParsing {
 public:
  BeforeParsing(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  void check() {
    if (text_.size() > kMostBytes) fail(0, fmt::format("at most {} MiB", kMostBytes >> 20), fmt::format("{} bytes", text_.size()));
    check_characters();
    for (std::size_t at = 0; (at = text_.find('<', at)) != text_.npos;) {
      const std::string_view rest = text_.substr(at);
      if (rest.starts_with("<!--"))
        at = behind("-->", at + 4, "a comment");
      else if (rest.starts_with("<![CDATA["))
        at = behind("]]>", at, "a CDATA section");
      else if (rest.starts_with("<?"))
        at = behind("?>", at, "a declaration");
      else if (rest.starts_with("<!"))
        fail(at, "a document without DOCTYPE", in_quotes(rest.substr(0, rest.find_first_of(" >\n\r\t"))),
             "no entities are needed or honoured");
      else
        at = behind_tag(at);
    }
  }

 private:
  [[noreturn]] void fail(std::size_t at, std::string expected, std::string got, std::string hint = {}) const {
    const auto before = text_.substr(0, at);
    const int line = 1 + static_cast<int>(std::ranges::count(before, '\n'));
    const std::size_t start = before.rfind('\n');
    const int column = 1 + static_cast<int>(start == before.npos ? at : at - start - 1);
    refuse(Code::xml_syntax, {"", {file_, line, column}}, std::move(expected), std::move(got), std::move(hint));
  }

  void check_characters() const {
    for (std::size_t at = 0; at < text_.size();) {
      const std::size_t length = utf8_character(text_.substr(at));
      const auto c = static_cast<unsigned char>(text_[at]);
      if (length == 0) fail(at, "text in UTF-8", fmt::format("the byte 0x{:02X}", c), at == 0 ? "UTF-16? Save it as UTF-8" : "");
      if (c < 0x20 && c != '\n' && c != '\r' && c != '\t') fail(at, "text", fmt::format("the byte 0x{:02X}", c));
      at += length;
    }
  }

  std::size_t behind(std::string_view end, std::size_t from, const char* what) const {
    const std::size_t at = text_.find(end, from);
    if (at == text_.npos) fail(from, fmt::format("the end of {}: {}", what, end), "the end of the file");
    return at + end.size();
  }

  std::size_t behind_tag(std::size_t at) {
    const std::size_t begin = at;
    std::size_t attributes = 0;
    char quote = 0;
    for (++at; at < text_.size(); ++at) {
      const char c = text_[at];
      if (quote != 0) {
        if (c == quote) quote = 0;
      } else if (c == '"' || c == '\'') {
        quote = c;
      } else if (c == '=') {
        if (++attributes > kMostAttributes) fail(begin, fmt::format("at most {} attributes", kMostAttributes), "more");
      } else if (c == '>') {
        break;
      }
    }
    if (at >= text_.size()) fail(begin, "the end of a tag: >", "the end of the file");
    if (text_[begin + 1] == '/') {
      --level_;
    } else {
      if (++elements_ > kMostElements) fail(begin, fmt::format("at most {} elements", kMostElements), "more");
      if (text_[at - 1] != '/' && ++level_ > kMostLevels) fail(begin, fmt::format("at most {} levels of elements", kMostLevels), "more");
    }
    return at + 1;
  }

  std::string_view text_;
  const std::string& file_;
  std::size_t elements_ = 0;
  int level_ = 0;
};

/// Columns, which tinyxml2 does not count: of what stands once in its line.
class Columns {
 public:
  explicit Columns(std::string_view text) {
    for (std::size_t at = 0; at <= text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      lines_.push_back(text.substr(at, end - at));
      at = end + 1;
    }
  }
  /// `from`: where in the line the element begins whose attribute it is; 0: unknown.
  int of(std::string_view word, int line, std::string_view before, int from = 0) const {
    if (line < 1 || static_cast<std::size_t>(line) > lines_.size()) return 0;
    const std::string_view text = lines_[static_cast<std::size_t>(line) - 1].substr(0, 2000);
    int found = 0;
    for (std::size_t at = static_cast<std::size_t>(from); (at = text.find(word, at)) != text.npos; at += word.size()) {
      if (at == 0 || before.find(text[at - 1]) == before.npos) continue;
      const std::size_t behind = at + word.size();
      if (before[0] != '<' ? text.find_first_not_of(" \t", behind) >= text.size() || text[text.find_first_not_of(" \t", behind)] != '='
                           : behind < text.size() && std::string_view(" \t\r/>").find(text[behind]) == std::string_view::npos)
        continue;
      if (from != 0) return static_cast<int>(at) + 1;
      if (found != 0) return 0;
      found = static_cast<int>(at) + 1;
    }
    return found;
  }

 private:
  std::vector<std::string_view> lines_;
};

void copy(const tinyxml2::XMLElement& from, XmlElement& to, const std::string& file, const Columns& columns) {
  to.name = from.Name();
  to.mark = {file, from.GetLineNum(), columns.of(to.name, from.GetLineNum(), "<")};
  for (const auto* a = from.FirstAttribute(); a; a = a->Next())
    to.attributes.push_back(
        {a->Name(),
         a->Value(),
         {file, a->GetLineNum(), columns.of(a->Name(), a->GetLineNum(), " \t\"'", a->GetLineNum() == to.mark.line ? to.mark.column : 0)}});
  for (const auto* child = from.FirstChild(); child; child = child->NextSibling()) {
    if (const auto* element = child->ToElement()) {
      XmlElement& copied = to.children.emplace_back();
      copied.parent = &to;
      copy(*element, copied, file, columns);
    } else if (const auto* text = child->ToText()) {
      to.has_text = to.has_text || std::string_view(text->Value()).find_first_not_of(" \t\r\n") != std::string_view::npos;
    }
  }
}

}  // namespace

const XmlAttribute* XmlElement::attribute(std::string_view wanted) const {
  for (const XmlAttribute& a : attributes)
    if (a.name == wanted) return &a;
  return nullptr;
}

std::string_view XmlElement::called() const {
  const XmlAttribute* a = attribute("name");
  return a ? std::string_view(a->value) : std::string_view();
}

std::string path_of(const XmlElement& element, std::string_view attribute) {
  std::string out;
  for (const XmlElement* e = &element; e; e = e->parent) {
    const std::string_view name = e->parent ? e->called() : std::string_view();
    out = printable(std::string_view(e->name).substr(0, kMostName)) +
          (name.empty() ? "" : fmt::format("[{}]", printable(name.substr(0, kMostName)))) + (out.empty() ? "" : "/") + out;
  }
  return attribute.empty() ? out : fmt::format("{}@{}", out, printable(attribute.substr(0, kMostName)));
}

std::unique_ptr<XmlElement> parse_xml(std::string_view text, const std::string& file) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  BeforeParsing(text, file).check();
  tinyxml2::XMLDocument document;
  document.Parse(text.data(), text.size());
  if (document.Error()) {
    const int line = document.ErrorLineNum();
    const auto got = [&]() -> std::string {
      switch (document.ErrorID()) {
        case tinyxml2::XML_ERROR_MISMATCHED_ELEMENT:
          return "a closing tag that is not that of the element";
        case tinyxml2::XML_ERROR_PARSING_ATTRIBUTE:
          return "an attribute that cannot be read, or stands twice";
        case tinyxml2::XML_ERROR_EMPTY_DOCUMENT:
          return "no element";
        case tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED:
          return "too many levels";
        default:
          return fmt::format("what the parser calls {}", document.ErrorName());
      }
    };
    refuse(Code::xml_syntax, {"", {file, line, 0}}, "an XML document", got(), "is every element closed, every value in quotes?");
  }
  const tinyxml2::XMLElement* root = document.RootElement();
  if (!root) refuse(Code::xml_syntax, {"", {file, 1, 0}}, "an XML document", "no element");
  if (const auto* second = root->NextSiblingElement())
    refuse(Code::xml_syntax, {"", {file, second->GetLineNum(), 0}}, "one root element",
           fmt::format("a second: {}", in_quotes(second->Name())));
  auto out = std::make_unique<XmlElement>();
  copy(*root, *out, file, Columns(text));
  return out;
}

}  // namespace cardan
