// OFF and its variants with normals (NOFF), colours (COFF) and texture coordinates (STOFF), in text.
#include <algorithm>

#include "io/cloud_builder.hpp"
#include "io/lines.hpp"
#include "io/mover.hpp"

namespace bitr::io {
namespace {

class Parser {
 public:
  explicit Parser(const File& file) : file_(file), lines_(file.text()) {}

  Result<Geometry> parse() {
    std::string_view line;
    if (!next(line)) return bad(file_, here(), "not an OFF file: it is empty");
    if (auto read = keyword(line); !read) return tl::unexpected(read.error());
    Words words(line);
    std::string_view first = words.next();
    if (first.empty()) {
      if (!next(line)) return bad(file_, here(), "the file ends before its counts");
      words = Words(line);
      first = words.next();
    }
    std::uint64_t vertices = 0, faces = 0;
    const std::string_view second = words.next();
    if (!parse_integer(first, vertices) || !parse_integer(second, faces)) {
      return bad(file_, here(), in_quotes(first), " and ", in_quotes(second),
                 " are not counts of vertices and faces");
    }
    if (auto fits = check(vertices, "vertices", 6); !fits) return tl::unexpected(fits.error());
    if (auto fits = check(faces, "faces", 2); !fits) return tl::unexpected(fits.error());

    CloudBuilder builder(file_, normals_, colors_);
    builder.reserve(vertices);
    for (std::uint64_t i = 0; i < vertices; ++i) {
      if (!next(line)) return bad(file_, here(), "the file ends after ", i, " of ", vertices, " vertices");
      if (auto read = vertex(line, builder); !read) return tl::unexpected(read.error());
    }
    for (std::uint64_t i = 0; i < faces; ++i) {
      if (!next(line)) return bad(file_, here(), "the file ends after ", i, " of ", faces, " faces");
      if (auto read = face(line, vertices); !read) return tl::unexpected(read.error());
    }
    return builder.finish(faces_.finish());
  }

 private:
  Place here() const { return Place::line(lines_.number()); }

  // The next line with something on it besides a comment.
  bool next(std::string_view& line) {
    while (lines_.next_filled(line)) {
      line = line.substr(0, line.find('#'));
      if (!Words(line).next().empty()) return true;
    }
    return false;
  }

  // Takes [ST][C][N]OFF off the line. The counts may follow at once: "OFF490 518 0" is common.
  Result<void> keyword(std::string_view& line) {
    while (is_blank(line.front())) line.remove_prefix(1);
    std::string_view rest = line;
    const auto take = [&rest](std::string_view prefix) {
      const bool there = rest.starts_with(prefix);
      if (there) rest.remove_prefix(prefix.size());
      return there;
    };
    take("ST");
    colors_ = take("C");
    normals_ = take("N");
    if (take("4OFF") || take("nOFF") || take("4nOFF"))
      return refuse(ErrorCode::unsupported, file_, in_quotes(line), ": only three-dimensional OFF is read");
    if (!take("OFF")) return bad(file_, here(), "not an OFF file: ", in_quotes(line.substr(0, 20)));
    if (Words(rest).next() == "BINARY")
      return refuse(ErrorCode::unsupported, file_, "binary OFF; only text OFF is read");
    line = rest;
    return {};
  }

  // Each row takes at least so many bytes, but for the separator that ends the last.
  Result<void> check(std::uint64_t count, std::string_view what, std::uint64_t least) const {
    if (count <= (lines_.remaining() + 1) / least) return {};
    return bad(file_, here(), count, " ", what, " need at least ", product(count, least), " bytes, ",
               lines_.remaining(), " remain");
  }

  Result<void> vertex(std::string_view line, CloudBuilder& builder) {
    Row row{};
    Words words(line);
    const int count = normals_ ? 6 : 3;
    for (int i = 0; i < count; ++i) {
      const std::string_view word = words.next();
      if (auto read = number(word, row[i]); !read) return read;
      if (file_.mover) file_.mover->word(i, word, row[i]);
    }
    for (int i = 0; colors_ && i < 3; ++i) {
      if (auto read = number(words.next(), row[role_red + i]); !read) return read;
    }
    return builder.add(row, here());
  }

  Result<void> number(std::string_view word, double& value) const {
    if (word.empty()) return bad(file_, here(), "the vertex has too few values");
    if (!parse_number(word, value))
      return bad(file_, here(), "the vertex has ", in_quotes(word), ", not a finite number");
    return {};
  }

  Result<void> face(std::string_view line, std::uint64_t vertices) {
    Words words(line);
    const std::string_view word = words.next();
    std::uint64_t corners = 0;
    if (!parse_integer(word, corners))
      return bad(file_, here(), in_quotes(word), " is not a number of corners");
    faces_.begin();
    for (std::uint64_t k = 0; k < corners; ++k) {
      const std::string_view index = words.next();
      std::uint32_t vertex = 0;
      if (index.empty()) return bad(file_, here(), "a face announces ", corners, " corners and has ", k);
      if (!parse_integer(index, vertex) || vertex >= vertices)
        return bad(file_, here(), "a face uses vertex ", in_quotes(index), "; there are ", vertices);
      faces_.corner(vertex);
    }
    return {};
  }

  const File& file_;
  Lines lines_;
  FanBuilder faces_;
  bool normals_ = false, colors_ = false;
};

}  // namespace

Result<Geometry> parse_off(const File& file) { return Parser(file).parse(); }

}  // namespace bitr::io
