// The bytes come from models/, by bitr_embed of cmake/embed.cmake.
#include <array>
#include <bitr/model.hpp>
#include <filesystem>

extern "C" {
extern const std::byte bitr_model_vessel_begin[], bitr_model_vessel_end[];
extern const std::byte bitr_model_aircraft_begin[], bitr_model_aircraft_end[];
}

namespace bitr {
namespace {

struct Embedded {
  const std::byte *begin, *end;
};

constexpr std::array<ShippedModel, 2> models = {{
    {"aircraft", "two parts of an aircraft, overlapping or not"},
    {"vessel", "two pieces of a broken vessel"},
}};
const std::array<Embedded, models.size()> bytes = {{
    {bitr_model_aircraft_begin, bitr_model_aircraft_end},
    {bitr_model_vessel_begin, bitr_model_vessel_end},
}};

}  // namespace

std::span<const ShippedModel> shipped_models() { return models; }

Result<Model> shipped_model(std::string_view name) {
  std::string known;
  for (std::size_t i = 0; i < models.size(); ++i) {
    if (models[i].name == name)
      return load_model({bytes[i].begin, bytes[i].end}, {.name = std::string(name), .mode = {}});
    known += (i == 0 ? "" : ", ") + std::string(models[i].name);
  }
  return fail(ErrorCode::invalid_argument,
              "no model is called " + std::string(name) + "; there are " + known);
}

Result<Model> find_model(const std::string& text) {
  std::error_code ignored;
  const std::filesystem::path path = text;
  const bool file = path.has_extension() || path.has_parent_path() || std::filesystem::exists(path, ignored);
  return file ? load_model(path) : shipped_model(text);
}

}  // namespace bitr
