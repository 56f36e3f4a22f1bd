#include <algorithm>
#include <bit>

#include "cg_product.spv.hpp"
#include "irreps/coupling.hpp"
#include "vk/kernel.hpp"

namespace bitr::vk {
namespace {

constexpr std::uint32_t product_group = 64;

class CgProductKernel : public Kernel {
 public:
  CgProductKernel(const KernelContext& site, const ops::CgProduct& op)
      : op_(op), capabilities_(site.context.capabilities()) {
    const auto terms = irreps::coupling_terms(op.a, op.b, op.out);
    std::vector<std::vector<irreps::CouplingTerm>> by_component(static_cast<std::size_t>(op.out.dim()));
    for (const auto& term : terms) by_component[term.component].push_back(term);
    for (const auto& some : by_component) terms_ = std::max(terms_, some.size());
    for (auto& some : by_component) {
      const irreps::CouplingTerm nothing{0, some.front().i, some.front().j, 0};
      some.resize(terms_, nothing);
      for (const auto& term : some) {
        add_constant(static_cast<std::uint32_t>(term.i + (term.j << 16)));
        add_constant(term.coefficient);
      }
    }
    const auto k = number(site.in.size() > 2 ? site.in[2].per_row : 0);
    pipeline_ = site.context.pipeline(
        shaders::cg_product,
        std::array{product_group, k, number(op.channels), number(op.shared), number(op.a.dim()),
                   number(op.b.dim()), number(op.out.dim()), number(terms_)});
  }

  void record(const Arguments& args) const override {
    const Slot &a = args.in[0], &b = args.in[1], &result = args.out[0];
    const bool edges = args.in.size() > 2;
    const std::size_t rows = args.layout.rows(result.rows);
    const std::size_t numbers = static_cast<std::size_t>(result.per_row) * padded(result.width);
    const std::size_t row_bytes =
        std::max(result.range.size, std::max(b.range.size, edges ? 0 : a.range.size)) / rows;
    const double cost = 4.0 * static_cast<double>(numbers * terms_);
    for (const RowRun& run : row_runs(rows, capabilities_.storage_range / row_bytes, cost)) {
      const std::size_t groups = (run.count * numbers + product_group - 1) / product_group;
      const auto across = static_cast<std::uint32_t>(std::min<std::size_t>(groups, capabilities_.groups));
      const auto down = static_cast<std::uint32_t>((groups + across - 1) / across);
      const Range left = edges ? a.range : run.of(a, rows);
      args.schedule.dispatch(pipeline_,
                             {left, run.of(b, rows), edges ? run.of(args.in[2], rows) : left, args.constants,
                              run.of(result, rows)},
                             RowParameters{static_cast<std::uint32_t>(run.count)}, {across, down, 1},
                             cost * static_cast<double>(run.count));
    }
  }

 private:
  const ops::CgProduct op_;
  std::size_t terms_ = 0;  // how many the component with most of them has
  PipelineOf<RowParameters> pipeline_;
  const Capabilities& capabilities_;
};

}  // namespace

template <>
KernelPtr make_kernel(const KernelContext& site, const ops::CgProduct& op) {
  return std::make_unique<CgProductKernel>(site, op);
}

}  // namespace bitr::vk
