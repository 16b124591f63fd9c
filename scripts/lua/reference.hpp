#pragma once
// The reference of the scenario API as the program knows it: read from the annotated Lua of scripts/prelude/cardan (the notation of the
// Lua language server: ---@class, ---@field, ---@param, ---@return), so that an editor, `help` and TAB say the same.
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace cardan {

/// A parameter, a field or a result: "step", "fun(t: number)", "called at its ticks".
struct ApiValue {
  std::string name, type, text;
  bool optional = false;
};

/// A function or a method.
struct ApiFunction {
  std::string owner;  // "Vehicle", "vec"; empty for a global function
  char joint = '.';   // of owner and name: '.' or ':'
  std::string name;
  std::string text;  // lines of the description
  std::vector<ApiValue> parameters, results;
  std::string signature() const;  // "hinge:force(value, [component])"
  std::string summary() const;    // the first sentence
};

/// An object with methods, a table of options, a module of functions.
struct ApiClass {
  std::string name, parent, text;
  std::vector<ApiValue> fields;
  std::vector<ApiFunction> functions;  // in the order of the file
};

class ApiReference {
 public:
  /// Of annotated files; what is no annotation or declaration is passed over.
  explicit ApiReference(const std::vector<std::string>& files);

  const std::map<std::string, ApiClass>& classes() const { return classes_; }
  const std::vector<ApiFunction>& functions() const { return functions_; }  // global ones
  /// Null if there is none. Classes are found by their names in any case: "hinge" is Hinge.
  const ApiClass* find_class(std::string_view name) const;
  /// Those with this name: "linearize", "hinge:force", "vec.add", "controller".
  std::vector<const ApiFunction*> find(std::string_view name) const;
  /// Own functions, then those of the parents.
  std::vector<const ApiFunction*> functions_of(const ApiClass&) const;
  /// All names that help takes, sorted.
  std::vector<std::string> topics() const;

  // As text
  std::string overview() const;
  std::string text_of(const ApiClass&) const;
  std::string text_of(const ApiFunction&) const;

 private:
  std::string fields_text(std::string_view type, const std::string& indent) const;
  std::map<std::string, ApiClass> classes_;
  std::vector<ApiFunction> functions_;
};

}  // namespace cardan
