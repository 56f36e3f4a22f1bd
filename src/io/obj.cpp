// Wavefront OBJ: "v" and "f" lines make the mesh, "vn" lines give normals where there are no faces to do it.
// Everything else (texture coordinates, groups, materials) has no bearing on shape and is passed over.
#include <algorithm>
#include <limits>

#include "io/cloud_builder.hpp"
#include "io/lines.hpp"
#include "io/mover.hpp"

namespace bitr::io {
namespace {

// The words of a statement; a "\" at the end of a line continues it on the next.
class Statement {
 public:
  Statement(std::string_view line, Lines& lines) : words_(line), lines_(lines) {}

  std::string_view next() {
    std::string_view word = words_.next();
    while (word == "\\") {
      std::string_view line;
      if (!lines_.next(line)) return {};
      words_ = Words(line);
      word = words_.next();
    }
    return word.starts_with('#') ? std::string_view{} : word;
  }

 private:
  Words words_;
  Lines& lines_;
};

class Parser {
 public:
  explicit Parser(const File& file) : file_(file), lines_(file.text()) {}

  Result<Geometry> parse() {
    std::string_view line;
    while (lines_.next_filled(line)) {
      Statement statement(line, lines_);
      const std::string_view key = statement.next();
      Result<void> read;
      if (key == "v") read = vertex(statement);
      if (key == "vn") read = normal(statement);
      if (key == "f") read = face(statement);
      if (!read) return tl::unexpected(read.error());
    }
    if (highest_ > positions_.size())
      return bad(file_, highest_place_, "a face uses vertex ", highest_, "; there are ", positions_.size());
    return build();
  }

 private:
  struct Vertex {
    Vec3d position;
    std::size_t line;
  };

  Place here() const { return Place::line(lines_.number()); }

  Result<void> vertex(Statement& statement) {
    // x y z, x y z w, x y z r g b or x y z w r g b
    double values[7];
    std::size_t count = 0;
    for (auto word = statement.next(); !word.empty(); word = statement.next()) {
      if (count == 7) return bad(file_, here(), "a vertex of more than 7 values");
      if (!parse_number(word, values[count]))
        return bad(file_, here(), "a vertex has ", in_quotes(word), ", not a finite number");
      if (file_.mover && count < 3) file_.mover->word(static_cast<int>(count), word, values[count]);
      ++count;
    }
    if (count < 3) return bad(file_, here(), "a vertex of ", count, " values; x, y and z need 3");
    positions_.push_back({{values[0], values[1], values[2]}, lines_.number()});
    if (count >= 6) colors_.push_back({values[count - 3], values[count - 2], values[count - 1]});
    return file_.mover ? file_.mover->end_row(file_, here()) : Result<void>();
  }

  Result<void> normal(Statement& statement) {
    Vec3d value;
    for (int i = 0; i < 3; ++i) {
      const std::string_view word = statement.next();
      if (!parse_number(word, value[i]))
        return bad(file_, here(), "a normal has ", in_quotes(word), ", not a finite number");
      if (file_.mover) file_.mover->word(role_nx + i, word, value[i]);
    }
    normals_.push_back(value);
    return file_.mover ? file_.mover->end_row(file_, here()) : Result<void>();
  }

  Result<void> face(Statement& statement) {
    faces_.begin();
    for (auto word = statement.next(); !word.empty(); word = statement.next()) {
      std::int64_t index = 0;
      const std::string_view vertex = word.substr(0, word.find('/'));
      if (!parse_integer(vertex, index)) return bad(file_, here(), in_quotes(word), " is not a face vertex");
      const auto count = static_cast<std::int64_t>(positions_.size());
      // Negative indices count back from the vertex read last; positive ones may still be ahead.
      const std::int64_t absolute = index < 0 ? (index < -count ? 0 : count + index + 1) : index;
      if (absolute < 1 || absolute > std::numeric_limits<std::uint32_t>::max())
        return bad(file_, here(), "a face uses vertex ", index, "; there are ", count, " so far");
      if (static_cast<std::uint64_t>(absolute) > highest_) {
        highest_ = static_cast<std::uint64_t>(absolute);
        highest_place_ = here();
      }
      faces_.corner(static_cast<std::uint32_t>(absolute - 1));
    }
    return {};
  }

  Result<Geometry> build() {
    auto triangles = faces_.finish();
    const bool normals = triangles.empty() && normals_.size() == positions_.size();
    const bool colors = colors_.size() == positions_.size();
    CloudBuilder builder(file_, normals, colors);
    builder.reserve(positions_.size());
    for (std::size_t i = 0; i < positions_.size(); ++i) {
      Row row{};
      std::copy_n(positions_[i].position.begin(), 3, row.begin());
      if (normals) std::copy_n(normals_[i].begin(), 3, row.begin() + role_nx);
      if (colors) std::copy_n(colors_[i].begin(), 3, row.begin() + role_red);
      if (auto added = builder.add(row, Place::line(positions_[i].line)); !added)
        return tl::unexpected(added.error());
    }
    return builder.finish(std::move(triangles));
  }

  const File& file_;
  Lines lines_;
  std::vector<Vertex> positions_;
  std::vector<Vec3d> normals_, colors_;
  FanBuilder faces_;
  std::uint64_t highest_ = 0;
  Place highest_place_;
};

}  // namespace

Result<Geometry> parse_obj(const File& file) { return Parser(file).parse(); }

}  // namespace bitr::io
