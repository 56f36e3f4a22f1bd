#include "module.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>

namespace reflect {
namespace {

constexpr Word magic = 0x07230203, header_words = 5;

// The SPIR-V specification's numbers.
enum Opcode : Word {
  op_name = 5,
  op_type_int = 21,
  op_type_float = 22,
  op_type_image = 25,
  op_type_sampled_image = 27,
  op_type_struct = 30,
  op_type_pointer = 32,
  op_spec_constant_composite = 51,
  op_variable = 59,
  op_decorate = 71,
  op_member_decorate = 72
};
enum Decoration : Word {
  spec_id = 1,
  block = 2,
  built_in = 11,
  non_writable = 24,
  non_readable = 25,
  binding = 33,
  descriptor_set = 34,
  offset = 35
};
enum Storage : Word { uniform_constant = 0, uniform = 2, push_constant = 9, storage_buffer = 12 };
constexpr Word workgroup_size = 25, image_of_buffer = 5;

// Four bytes a word, the lowest first.
std::string text(std::span<const Word> words) {
  std::string result;
  for (const Word word : words)
    for (int shift = 0; shift < 32; shift += 8) {
      const char c = static_cast<char>(word >> shift & 0xff);
      if (c == 0) return result;
      result += c;
    }
  return result;
}

[[noreturn]] void refuse(const std::string& why) { throw std::runtime_error(why); }

}  // namespace

Module::Module(std::span<const Word> words) {
  if (words.size() < header_words || words[0] != magic) refuse("not SPIR-V");
  for (std::size_t at = header_words; at < words.size();) {
    const std::size_t count = words[at] >> 16;
    if (count == 0 || count > words.size() - at) refuse("ends within an instruction");
    take(words[at] & 0xffff, words.subspan(at + 1, count - 1));
    at += count;
  }
}

void Module::take(Word opcode, std::span<const Word> operands) {
  const auto after = [&](std::size_t n) {
    return Words(operands.begin() + std::ptrdiff_t(n), operands.end());
  };
  // The specification promises each of these as many operands as are read.
  if (opcode == op_name)
    names_[operands[0]] = text(operands.subspan(1));
  else if (opcode == op_decorate)
    decorations_[operands[0]][operands[1]] = after(2);
  else if (opcode == op_member_decorate)
    member_decorations_[operands[0]][operands[1]][operands[2]] = after(3);
  else if (opcode >= op_type_int && opcode <= op_type_pointer)
    types_[operands[0]] = {opcode, after(1)};
  else if (opcode == op_spec_constant_composite)
    composites_[operands[1]] = after(2);
  else if (opcode == op_variable)
    variables_.push_back({operands[1], operands[2], type(operands[0]).operands.at(1)});
}

const Module::Type& Module::type(Word id) const {
  const auto found = types_.find(id);
  if (found == types_.end()) refuse("a type that is not understood");
  return found->second;
}

Word Module::decoration(Word id, Word what) const {
  const auto all = decorations_.find(id);
  if (all == decorations_.end() || !all->second.contains(what))
    refuse("decoration " + std::to_string(what) + " is missing");
  return all->second.at(what).at(0);
}

bool Module::is_decorated(const Variable& buffer, Word what) const {
  if (const auto own = decorations_.find(buffer.id); own != decorations_.end() && own->second.contains(what))
    return true;
  const auto members = member_decorations_.find(buffer.type);
  return members != member_decorations_.end() &&
         std::ranges::all_of(members->second,
                             [&](const auto& member) { return member.second.contains(what); });
}

std::string Module::buffer_access(const Variable& variable) const {
  const auto own = decorations_.find(variable.type);
  if (type(variable.type).opcode != op_type_struct || own == decorations_.end() ||
      !own->second.contains(block))
    refuse("a binding that is no single buffer");
  if (variable.storage == uniform) return "constant";
  const bool read = !is_decorated(variable, non_readable), written = !is_decorated(variable, non_writable);
  if (!read && !written) refuse("a buffer neither read nor written");
  return !written ? "read" : read ? "modify" : "write";
}

// Empty: of a variable that the caller binds nothing to.
std::string Module::access(const Variable& variable) const {
  if (variable.storage == uniform || variable.storage == storage_buffer) return buffer_access(variable);
  if (variable.storage != uniform_constant) return "";
  const Type* image = &type(variable.type);
  if (image->opcode == op_type_sampled_image) image = &type(image->operands.at(0));
  if (image->opcode != op_type_image || image->operands.at(1) != image_of_buffer)
    refuse("a binding that is neither a buffer nor a texel buffer");
  return "texels";
}

// Bytes of what push constants may hold (shaders/common/parameters.glsl).
Word Module::size(Word id) const {
  const Type& of = type(id);
  if (of.opcode == op_type_int || of.opcode == op_type_float) return of.operands.at(0) / 8;
  if (of.opcode != op_type_struct) refuse("push constants other than numbers");
  Word end = 0;
  for (Word i = 0; i < of.operands.size(); ++i) {
    const Word at = member_decorations_.at(id).at(i).at(offset).at(0);
    if (at != end) refuse("push constants with gaps");
    end = at + size(of.operands[i]);
  }
  return end;
}

void Module::add_parameters(const Variable& push, Interface& found) const {
  const Type& members = type(push.type);
  if (members.operands.size() != 1 || type(members.operands[0]).opcode != op_type_struct)
    refuse("push constants that are no structure");
  found.parameters = names_.at(members.operands[0]);
  found.parameter_bytes = size(push.type);
}

Word Module::count_specializations() const {
  std::set<Word> ids;
  Word group_size = ~Word{0};
  for (const auto& [id, all] : decorations_) {
    if (const auto found = all.find(spec_id); found != all.end()) ids.insert(found->second.at(0));
    if (const auto found = all.find(built_in); found != all.end() && found->second.at(0) == workgroup_size)
      if (const auto sizes = composites_.find(id); sizes != composites_.end())
        group_size = decoration(sizes->second.at(0), spec_id);
  }
  if (group_size != 0) refuse("layout(local_size_x_id = 0) is missing");
  if (*ids.rbegin() != ids.size() - 1) refuse("specialization constants with gaps between them");
  return static_cast<Word>(ids.size());
}

Interface Module::interface() const {
  Interface found;
  std::map<Word, std::string> bindings;
  for (const Variable& variable : variables_) {
    if (variable.storage == push_constant) add_parameters(variable, found);
    const std::string how = access(variable);
    if (how.empty()) continue;
    if (decoration(variable.id, descriptor_set) != 0) refuse("a binding outside of set 0");
    if (!bindings.emplace(decoration(variable.id, binding), how).second) refuse("two buffers of one binding");
  }
  for (const auto& [number, how] : bindings) {
    if (number != found.bindings.size())
      refuse("binding " + std::to_string(found.bindings.size()) + " is missing");
    found.bindings.push_back(how);
  }
  found.specializations = count_specializations();
  return found;
}

}  // namespace reflect
