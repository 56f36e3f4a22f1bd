#include "vk/pair_tables.hpp"

#include <algorithm>
#include <bit>
#include <map>

#include "core/failure.hpp"

namespace bitr::vk {
namespace {

using Eigen::MatrixXd;
using Numbers = std::vector<std::uint32_t>;

// pair_tables.glsl
constexpr std::uint32_t swapped = 1, degree1 = 2;

// Columns of a network's last matrix with its offset, padded to fours (QUADS of pair_networks.comp).
constexpr Eigen::Index network_columns = ops::radial_width + 4;

void add(Numbers& to, double value) { to.push_back(std::bit_cast<std::uint32_t>(static_cast<float>(value))); }
void add(Numbers& to, const MatrixXd& rows) {
  for (Eigen::Index r = 0; r < rows.rows(); ++r)
    for (Eigen::Index c = 0; c < rows.cols(); ++c) add(to, rows(r, c));
}
void pad(Numbers& numbers, std::size_t count) {
  numbers.resize((numbers.size() + count - 1) / count * count);
}
std::uint32_t vectors(const Numbers& numbers) { return static_cast<std::uint32_t>(numbers.size() / 4); }

class Packer {
 public:
  explicit Packer(const ops::PairAttention& op) : op_(op) {}

  PairTables pack() {
    const std::size_t pairs = pair_degrees.size() * pair_degrees.size();
    out_.linear = op_.blocks.size() == 2 * pairs;
    std::size_t rays = 0;
    for (const auto& table : op_.tables) rays = std::max(rays, table.rays.size());
    while ((std::size_t{1} << out_.search) <= rays) ++out_.search;
    in_vectors_ = 0;
    for (const auto& [d, m] : op_.fiber_in) in_vectors_ = std::max(in_vectors_, (m + 3) / 4);
    for (int set = 0; set < (out_.linear ? 2 : 1); ++set)
      for (const auto& to : pair_degrees)
        for (const auto& from : pair_degrees)
          add_block(block(from, to, set == 0 ? 0 : op_.value_fiber.channels(to)));
    for (Numbers* numbers : {&out_.heads, &out_.rays, &out_.sectors}) {
      if (numbers->empty()) numbers->push_back(0);
      pad(*numbers, 64);
    }
    return std::move(out_);
  }

 private:
  const ops::PairBlock& block(irreps::Degree from, irreps::Degree to, int out_begin) const {
    for (const auto& block : op_.blocks)
      if (block.in == from && block.out == to && block.out_begin == out_begin) return block;
    throw Failure(ErrorCode::unsupported,
                  "a two-sided layer has no part from degree " + from.str() + " to " + to.str());
  }

  void add_block(const ops::PairBlock& block) {
    std::size_t tables = 0;
    for (const auto& table : op_.tables)
      if (table.begin == block.coefficients) {
        add_table(block, table);
        ++tables;
      }
    const bool symmetric = block.in.symmetric() && block.out.symmetric();
    if (tables != (symmetric ? 2u : 1u))
      throw Failure(ErrorCode::unsupported, "a part of a two-sided layer has " + std::to_string(tables) +
                                                " radial tables, from degree " + block.in.str() + " to " +
                                                block.out.str());
  }

  void add_table(const ops::PairBlock& block, const ops::SectorTable& table) {
    const std::size_t form = table.scale_degree == 1 ? 0 : 2;
    const auto first_ray = static_cast<std::uint32_t>(out_.rays.size()), first = vectors(out_.sectors);
    for (const auto& [cos, sin] : table.rays) add(out_.rays, sin / (cos + sin));
    // Beyond every direction there is.
    while (out_.rays.size() < first_ray + (std::size_t{1} << out_.search) - 1) add(out_.rays, 2.0);
    for (std::size_t s = 0; s < table.sectors(); ++s) {
      if (form > 0) {
        for (const double x : table.Q[s]) add(out_.sectors, x);
        pad(out_.sectors, 4);
      }
      add_columns(out_.sectors, block, table.slope[s]);
      if (form > 0) add_columns(out_.sectors, block, table.offset[s]);
    }
    const auto stride = (vectors(out_.sectors) - first) / static_cast<std::uint32_t>(table.sectors());
    out_.heads.insert(out_.heads.end(),
                      {first_ray, first, stride, (table.swapped ? swapped : 0) | (form > 0 ? 0 : degree1)});
    for (const double x : table.q) add(out_.heads, x);
    add(out_.heads, table.network->eps);
    const std::uint32_t network = form > 0 ? add_network(*table.network) : 0;
    out_.heads.insert(out_.heads.end(), {network, vectors(out_.sectors), 0, 0});
    if (form > 0) add_columns(out_.sectors, block, last_matrix(table));
    ++out_.tables;
  }

  // From (freq, output channels, input channels) to (freq, input channels in vec4s, output channels), a
  // column after the other.
  void add_columns(Numbers& to, const ops::PairBlock& block, const MatrixXd& columns) const {
    const int inputs = block.in_channels, padded_inputs = 4 * in_vectors_;
    std::size_t at = to.size();
    to.resize(at +
              static_cast<std::size_t>(columns.cols() * block.freq() * block.out_channels * padded_inputs));
    for (Eigen::Index column = 0; column < columns.cols(); ++column)
      for (int f = 0; f < block.freq(); ++f)
        for (int c = 0; c < padded_inputs; c += 4)
          for (int o = 0; o < block.out_channels; ++o, at += 4)
            for (int i = 0; i < std::min(4, inputs - c); ++i)
              to[at + i] = std::bit_cast<std::uint32_t>(
                  static_cast<float>(columns((f * block.out_channels + o) * inputs + c + i, column)));
  }

  // The network's last layer in the coefficients' order, its offset as one more column.
  static MatrixXd last_matrix(const ops::SectorTable& table) {
    const ops::RadialNetwork& network = *table.network;
    const Eigen::Index freq = table.basis.cols(), channels = table.size / freq;
    MatrixXd from = MatrixXd::Zero(network.w3.rows(), network_columns),
             to = MatrixXd::Zero(from.rows(), from.cols());
    from.leftCols(network.w3.cols()) = network.w3;
    from.col(network.w3.cols()) = network.c3;
    for (Eigen::Index target = 0; target < freq; ++target)
      for (Eigen::Index c = 0; c < channels; ++c)
        for (Eigen::Index f = 0; f < freq; ++f)
          to.row(target * channels + c) += table.scale * table.basis(target, f) * from.row(c * freq + f);
    return to;
  }

  // Its other layers, each before its norm less its mean; a network that serves several tables is there once.
  std::uint32_t add_network(const ops::RadialNetwork& network) {
    const auto centred = [](const MatrixXd& layer) {
      return MatrixXd(layer.rowwise() - layer.colwise().mean());
    };
    const auto [place, added] = networks_.emplace(&network, vectors(out_.sectors));
    if (added)
      for (const MatrixXd& part :
           {centred(network.w1), MatrixXd(network.gain1), MatrixXd(network.bias1), centred(network.w2),
            centred(network.c2), MatrixXd(network.gain2), MatrixXd(network.bias2)})
        add(out_.sectors, part);
    return place->second;
  }

  const ops::PairAttention& op_;
  int in_vectors_ = 0;
  std::map<const ops::RadialNetwork*, std::uint32_t> networks_;
  PairTables out_;
};

}  // namespace

PairTables pack_pair_tables(const ops::PairAttention& op) { return Packer(op).pack(); }

ops::PairAttention without_tables(const ops::PairAttention& op) {
  return {.heads = op.heads,
          .fiber_in = op.fiber_in,
          .fiber_out = op.fiber_out,
          .value_fiber = op.value_fiber,
          .key_fiber = op.key_fiber,
          .blocks = op.blocks,
          .tables = {},
          .coefficient_count = op.coefficient_count,
          .query = op.query,
          .project = op.project,
          .self = op.self,
          .relu = op.relu,
          .planes = op.planes,
          .relu_square = op.relu_square};
}

}  // namespace bitr::vk
