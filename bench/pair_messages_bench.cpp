// Two exact ways to evaluate the messages of a two-sided layer (degrees ≤ 1, 4 → 4 channels, 24 edges at
// once), given the edges' radial coefficients:
//   frames   turn features into the edges' frames, where SO(2)×SO(2) leaves few terms, and the messages back
//   factors  apply K_J of one side, then of the other, then mix channels (the product form of the kernel)
#include <benchmark/benchmark.h>

#include <cmath>

#include "core/random.hpp"
#include "cpu/pair_messages.hpp"

namespace {

using namespace bitr;
using irreps::Degree;
using irreps::Fiber;
using Edges = Eigen::Array<float, 24, 1>;
using Buffer = std::vector<Edges, Eigen::aligned_allocator<Edges>>;

constexpr int channels = 4;
const Fiber fiber{{{0, 0}, channels}, {{0, 1}, channels}, {{1, 0}, channels}, {{1, 1}, channels}};

struct Problem {
  std::vector<ops::PairBlock> blocks;
  Buffer coefficients, features, direction[2];
  cpu::Frame<Edges> frames[2];

  Problem() {
    int count = 0;
    for (const auto& [in, ci] : fiber)
      for (const auto& [out, co] : fiber) {
        blocks.push_back({in, out, ci, co, 0, count});
        count += blocks.back().freq() * ci * co;
      }
    Random random(1);
    const auto fill = [&](Buffer& buffer, int size) {
      buffer.resize(size);
      for (Edges& e : buffer)
        for (float& x : e) x = static_cast<float>(random.normal());
    };
    fill(coefficients, count);
    fill(features, fiber.size());
    for (int s = 0; s < 2; ++s) {
      fill(direction[s], 3);
      Buffer& v = direction[s];
      const Edges length = (v[0].square() + v[1].square() + v[2].square()).sqrt();
      frames[s].set(v.data(), length);
      for (Edges& component : v) component /= length;
    }
  }
};

void frames(benchmark::State& state) {
  const Problem problem;
  std::vector<std::vector<cpu::Term>> terms;
  for (const auto& block : problem.blocks) terms.push_back(cpu::pair_terms(block));
  Buffer turned, messages(fiber.size());
  for (auto _ : state) {
    turned = problem.features;
    cpu::turn(fiber, problem.frames, turned.data(), true);
    for (Edges& m : messages) m.setZero();
    for (std::size_t b = 0; b < problem.blocks.size(); ++b) {
      const auto& block = problem.blocks[b];
      cpu::add_messages(block, terms[b], &problem.coefficients[block.coefficients],
                        &turned[fiber.offset(block.in)], &messages[fiber.offset(block.out)]);
    }
    cpu::turn(fiber, problem.frames, messages.data(), false);
    benchmark::DoNotOptimize(messages.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * 24);
}
BENCHMARK(frames);

// y_J = K_J(v) x for every J between two degrees ≤ 1; components `step` apart.
int apply_side(int in, int out, const Buffer& v, const Edges* x, int step_in, Edges* y, int step_out,
               int step_J) {
  if (in == 0 && out == 0) {
    y[0] = x[0];
    return 1;
  }
  if (in == 0) {
    for (int i = 0; i < 3; ++i) y[i * step_out] = v[i] * x[0];
    return 1;
  }
  const Edges along = v[0] * x[0] + v[1] * x[step_in] + v[2] * x[2 * step_in];
  if (out == 0) {
    y[0] = along;
    return 1;
  }
  constexpr float k0 = -0.57735027f, k1 = 0.70710678f, k2 = 0.40824829f;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    y[i * step_out] = k0 * x[i * step_in];
    y[step_J + i * step_out] = k1 * (v[j] * x[k * step_in] - v[k] * x[j * step_in]);
    y[2 * step_J + i * step_out] = k2 * (3 * v[i] * along - x[i * step_in]);
  }
  return 3;
}

void factors(benchmark::State& state) {
  const Problem problem;
  Buffer messages(fiber.size()), half(3 * 9), product(9 * 9);
  for (auto _ : state) {
    for (Edges& m : messages) m.setZero();
    for (const auto& block : problem.blocks) {
      const auto [in, out] = std::pair(block.in, block.out);
      const int in2 = 2 * in.q + 1, out1 = 2 * out.p + 1, out2 = 2 * out.q + 1;
      for (int c = 0; c < block.in_channels; ++c) {
        const Edges* x = &problem.features[fiber.offset(in) + c * in.dim()];
        int freq1 = 1, freq2 = 1;
        // half[J₁][out1][in2], then product[J₁][J₂][out1][out2].
        for (int j = 0; j < in2; ++j)
          freq1 = apply_side(in.p, out.p, problem.direction[0], x + j, in2, &half[j], in2, out1 * in2);
        for (int J = 0; J < freq1; ++J)
          for (int i = 0; i < out1; ++i)
            freq2 = apply_side(in.q, out.q, problem.direction[1], &half[(J * out1 + i) * in2], 1,
                               &product[J * (2 * std::min(in.q, out.q) + 1) * out.dim() + i * out2], 1,
                               out.dim());
        for (int f = 0; f < freq1 * freq2; ++f)
          for (int o = 0; o < block.out_channels; ++o) {
            const Edges& weight =
                problem
                    .coefficients[block.coefficients + (f * block.out_channels + o) * block.in_channels + c];
            Edges* to = &messages[fiber.offset(out) + o * out.dim()];
            for (int i = 0; i < out.dim(); ++i) to[i] += weight * product[f * out.dim() + i];
          }
      }
    }
    benchmark::DoNotOptimize(messages.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * 24);
}
BENCHMARK(factors);

}  // namespace
