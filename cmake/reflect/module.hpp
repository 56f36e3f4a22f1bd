// A SPIR-V compute shader, as far as its caller is concerned.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace reflect {

using Word = std::uint32_t;
using Words = std::vector<Word>;

/// What the shader expects; what the library has no use for is a std::runtime_error.
struct Interface {
  std::vector<std::string> bindings;  ///< set 0's, from 0: names of vk::Access
  std::string parameters;             ///< the structure of its push constants; empty: none
  Word parameter_bytes = 0;
  Word specializations = 0;  ///< constants 0 … n−1; 0 is the work group's size
};

class Module {
 public:
  explicit Module(std::span<const Word> words);
  Interface interface() const;

 private:
  struct Type {
    Word opcode = 0;
    Words operands;  ///< after the result
  };
  struct Variable {
    Word id, storage, type;
  };
  using Decorations = std::map<Word, Words>;

  void take(Word opcode, std::span<const Word> operands);
  const Type& type(Word id) const;
  /// An operand of the decoration, or of one that is absent a std::runtime_error.
  Word decoration(Word id, Word what) const;
  bool is_decorated(const Variable& buffer, Word what) const;
  std::string access(const Variable& variable) const;
  std::string buffer_access(const Variable& variable) const;
  void add_parameters(const Variable& block, Interface& found) const;
  Word size(Word id) const;
  Word count_specializations() const;

  std::map<Word, std::string> names_;
  std::map<Word, Decorations> decorations_;
  std::map<Word, std::map<Word, Decorations>> member_decorations_;
  std::map<Word, Type> types_;
  std::map<Word, Words> composites_;  ///< specialization constants of several
  std::vector<Variable> variables_;
};

}  // namespace reflect
