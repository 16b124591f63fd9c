#pragma once
// XML of untrusted origin as a tree of elements with places. Names, attributes and nesting: text between tags is only noticed.
#include <list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/diagnostic.hpp"

namespace cardan {

struct XmlAttribute {
  std::string name, value;
  SourceMark mark;
};

struct XmlElement {
  std::string name;
  SourceMark mark;
  std::vector<XmlAttribute> attributes;
  std::list<XmlElement> children;  // whose addresses stay
  const XmlElement* parent = nullptr;
  bool has_text = false;  // other than white space

  /// Null if there is none.
  const XmlAttribute* attribute(std::string_view name) const;
  /// The value of the attribute `name`; empty if there is none.
  std::string_view called() const;
};

/// "robot/link[arm]/inertial", and "@mass" behind it for an attribute: the key path of answers.
std::string path_of(const XmlElement& element, std::string_view attribute = {});

/// The root of the document; `file` names it in errors. Throws InputError C1201 for what is not one XML document in UTF-8, has a DOCTYPE
/// (which alone could declare entities), or is too much: 16 MiB, 200 000 elements, 95 levels, 100 attributes of one element.
std::unique_ptr<XmlElement> parse_xml(std::string_view text, const std::string& file);

}  // namespace cardan
