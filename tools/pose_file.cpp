#include "pose_file.hpp"

#include <array>
#include <bitr/io.hpp>
#include <cmath>

#include "io/complaint.hpp"
#include "io/lines.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

constexpr double tolerance = 1e-6;  // RᵀR differs from I by less: files may have fewer digits than a double

bool is_rotation(const std::array<double, 9>& r) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const double dot = r[i] * r[j] + r[3 + i] * r[3 + j] + r[6 + i] * r[6 + j];
      if (!(std::abs(dot - (i == j)) <= tolerance)) return false;
    }
  return r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
             r[2] * (r[3] * r[7] - r[4] * r[6]) >
         0;
}

// Four lines of four numbers; lines that begin with "#" are comments.
std::optional<Json> numbers_in(std::string_view content) {
  Json rows = Json::array();
  io::Lines lines(content);
  for (std::string_view line; lines.next_filled(line);) {
    Json row = Json::array();
    io::Words words(line);
    std::string_view word = words.next();
    if (word.starts_with('#')) continue;
    for (; !word.empty(); word = words.next()) {
      double value = 0;
      if (row.size() == 4 || !io::parse_number(word, value)) return std::nullopt;
      row.push_back(value);
    }
    if (rows.size() == 4 || row.size() != 4) return std::nullopt;
    rows.push_back(std::move(row));
  }
  return rows.size() == 4 ? std::optional(std::move(rows)) : std::nullopt;
}

}  // namespace

Result<Pose> read_pose(const std::string& path) {
  const auto bytes = io::read_file(path);
  if (!bytes) return tl::unexpected(bytes.error());
  const char* text = reinterpret_cast<const char*>(bytes->data());
  const std::string_view content(text, bytes->size());
  if (const auto matrix = numbers_in(content)) return parse_pose(*matrix, path + ": its matrix");
  const Json json = Json::parse(content, nullptr, false);
  const auto refuse = [&](const std::string& why) { return fail(ErrorCode::bad_file, path + ": " + why); };
  if (!json.is_object()) return refuse("is neither a JSON object nor four lines of four numbers");
  auto matrix = json.find("T_reference_source");
  if (matrix == json.end()) matrix = json.find("transform");
  if (matrix == json.end()) return refuse("has neither \"T_reference_source\" nor \"transform\"");
  return parse_pose(*matrix, path + ": \"" + matrix.key() + "\"");
}

Result<std::optional<Pose>> read_optional_pose(const std::string& path) {
  if (path.empty()) return std::nullopt;
  const auto pose = read_pose(path);
  if (!pose) return tl::unexpected(pose.error());
  return *pose;
}

FileWriter pose_writer(const std::string& path, const Pose& pose) {
  const auto matrix = pose.matrix();
  std::string text;
  for (std::size_t i = 0; i < matrix.size(); ++i) {
    io::append(text, matrix[i]);
    text += i % 4 == 3 ? '\n' : ' ';
  }
  return {path, [text](const std::string&) { return bytes_of(text); }};
}

Result<Pose> parse_pose(const Json& matrix, const std::string& name) {
  const auto refuse = [&](const std::string& why) { return fail(ErrorCode::bad_file, name + why); };
  std::array<double, 16> entries{};
  bool numbers = matrix.is_array() && matrix.size() == 4;
  for (std::size_t row = 0; numbers && row < 4; ++row) {
    const Json& values = matrix[row];
    numbers = values.is_array() && values.size() == 4;
    for (std::size_t column = 0; numbers && column < 4; ++column) {
      numbers = values[column].is_number();
      if (numbers) entries[4 * row + column] = values[column].get<double>();
    }
  }
  if (!numbers) return refuse(" is no 4×4 array of numbers");

  Pose pose;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) pose.rotation[3 * row + column] = entries[4 * row + column];
    pose.translation[row] = entries[4 * row + 3];
    if (!std::isfinite(pose.translation[row])) return refuse(" is not finite");
  }
  const bool last_row = entries[12] == 0 && entries[13] == 0 && entries[14] == 0 && entries[15] == 1;
  if (!is_rotation(pose.rotation) || !last_row)
    return refuse(" is no rigid motion: R must be a rotation to 1e-6, the last row 0 0 0 1");
  return pose;
}

void print_matrix(const Pose& T_reference_source, std::FILE* out) {
  const auto matrix = T_reference_source.matrix();
  std::fprintf(out, "T_reference_source\n");
  for (int row = 0; row < 4; ++row)
    std::fprintf(out, "  %15.9g %15.9g %15.9g %15.9g\n", matrix[4 * row], matrix[4 * row + 1],
                 matrix[4 * row + 2], matrix[4 * row + 3]);
}

Json pose_json(const Pose& pose) {
  const auto& r = pose.rotation;
  return {{"transform", matrix_json(pose)},
          {"rotation", {{r[0], r[1], r[2]}, {r[3], r[4], r[5]}, {r[6], r[7], r[8]}}},
          {"translation", pose.translation}};
}

Json errors_json(const Pose& pose, const Pose& truth) {
  return {{"rotation_degrees", rotation_error_degrees(pose, truth)},
          {"translation", translation_error(pose, truth)}};
}

}  // namespace bitr::tool
