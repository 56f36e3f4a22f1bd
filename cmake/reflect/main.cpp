// bitr_reflect NAME PLAIN SHIPPED HEADER: from a shader's SPIR-V before and after optimisation, the C++ header that
// declares shaders::NAME. Facts come from the first, which still has names and what is declared but unused, words
// from the second.
#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include "module.hpp"

namespace reflect {
namespace {

Words read(const char* path) {
  std::ifstream in(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  if (!in || bytes.empty() || bytes.size() % 4 != 0)
    throw std::runtime_error("cannot be read, or not SPIR-V");
  Words words;
  for (std::size_t at = 0; at < bytes.size(); at += 4) {
    Word word = 0;
    for (std::size_t i = 4; i-- > 0;) word = word << 8 | static_cast<unsigned char>(bytes[at + i]);
    words.push_back(word);
  }
  return words;
}

std::string header(const std::string& name, const Interface& shader, const Words& shipped) {
  std::ostringstream out;
  out << "// The shader " << name << ", made by bitr_reflect.\n#pragma once\n\n"
      << "#include <array>\n\n#include \"vk/parameters.hpp\"\n#include \"vk/shader.hpp\"\n\nnamespace "
         "bitr::vk::shaders {\n\n"
      << "inline constexpr std::uint32_t " << name << "_spirv[] = {";
  for (std::size_t i = 0; i < shipped.size(); ++i) out << (i % 12 == 0 ? "\n" : "") << shipped[i] << ',';
  out << "\n};\ninline constexpr std::array<Access, " << shader.bindings.size() << "> " << name
      << "_bindings{";
  for (const std::string& access : shader.bindings) out << "Access::" << access << ", ";
  const std::string parameters = shader.parameters.empty() ? "NoParameters" : shader.parameters;
  out << "};\ninline constexpr ShaderOf<" << parameters << ", " << shader.specializations << "> " << name
      << "{\"" << name << "\", " << name << "_spirv, " << name << "_bindings};\n";
  if (!shader.parameters.empty())
    out << "static_assert(sizeof(" << parameters << ") == " << shader.parameter_bytes << ");\n";
  out << "\n}  // namespace bitr::vk::shaders\n";
  return out.str();
}

// Leaves a file alone that is right already: what includes it need not be compiled again.
void write(const char* path, const std::string& text) {
  std::ifstream before(path, std::ios::binary);
  if (std::string((std::istreambuf_iterator<char>(before)), {}) == text) return;
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw std::runtime_error("cannot be written");
}

}  // namespace
}  // namespace reflect

int main(int count, char** arguments) {
  using namespace reflect;
  if (count != 5) {
    std::fprintf(stderr, "usage: bitr_reflect NAME PLAIN SHIPPED HEADER\n");
    return 2;
  }
  const char* path = arguments[2];
  try {
    const Interface shader = Module(read(path)).interface();
    path = arguments[3];
    const Words shipped = read(path);
    Module{shipped};
    path = arguments[4];
    write(path, header(arguments[1], shader, shipped));
    return 0;
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "bitr_reflect: %s: %s\n", path, failure.what());
    return 1;
  }
}
