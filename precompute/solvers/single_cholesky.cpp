#include "precompute/solvers/single_cholesky.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <omp.h>
#include <utility>

#include "common/core/decompositions.h"
#include "precompute/solvers/blas.h"
#include "precompute/solvers/dissection.h"

namespace exmat::precompute {
namespace {

using Index = std::int32_t;
using Node = Elimination::Node;
using Strided = Eigen::Map<Eigen::MatrixXf, 0, Eigen::OuterStride<>>;

constexpr int kSmall = 24;             // columns that are factorised without BLAS
constexpr int kPanel = 192;            // columns that are factorised at once
constexpr int kTile = 512;             // rows and columns of a front that a thread updates at once
constexpr std::size_t kColumns = 64;   // vertices whose columns a thread adds to a front at once
constexpr int kTogether = 64;          // right-hand sides that go through the factors together
constexpr double kSubtree = 1.0 / 32;  // of all work: larger subtrees are not one thread's alone
constexpr double kLittleWork = 1e7;    // operations: threads that wait for each other cost more
constexpr float kZero = 0, kOne = 1, kMinusOne = -1;

std::size_t index_of(Index i) { return static_cast<std::size_t>(i); }

// Lower L in place of the lower triangle of A [n x n], rows `stride` apart. False where A is not positive definite.
bool factorise_diagonal(float* a, int n, int stride) {
  if (n <= kSmall) {
    Strided A(a, n, n, Eigen::OuterStride<>(stride));
    const Eigen::LLT<Eigen::Ref<Strided>> factor(A);
    return factor.info() == Eigen::Success && A.diagonal().allFinite();
  }
  const int half = n / 2, rest = n - half;
  float *below = a + half, *last = below + static_cast<std::ptrdiff_t>(half) * stride;
  if (!factorise_diagonal(a, half, stride)) return false;
  strsm_("R", "L", "T", "N", &rest, &half, &kOne, a, &stride, below, &stride);
  ssyrk_("L", "N", &rest, &half, &kMinusOne, below, &stride, &kOne, last, &stride);
  return factorise_diagonal(last, rest, stride);
}

// work(0), work(1), ..., by several threads where they share it.
template <typename Work>
void for_each(std::size_t count, bool shared, const Work& work) {
  if (!shared || count < 2) {
    for (std::size_t i = 0; i < count; ++i) work(i);
    return;
  }
#pragma omp taskloop grainsize(1)
  for (std::size_t i = 0; i < count; ++i) work(i);
}

struct Span {
  int begin, size;
};

std::vector<Span> tiles(int begin, int end) {
  std::vector<Span> spans;
  for (; begin < end; begin += kTile) spans.push_back({begin, std::min(kTile, end - begin)});
  return spans;
}

// C -= L L^T, in the lower triangle of C's first columns: rows of L begin at `lower`, and C [rows x columns].
void update(const float* lower, int lower_stride, int width, float* C, int stride, int rows, int columns, bool shared) {
  std::vector<std::pair<Span, Span>> parts;
  for (const Span& column : tiles(0, columns))
    for (const Span& row : tiles(column.begin, rows)) parts.emplace_back(row, column);
  for_each(parts.size(), shared, [&](std::size_t i) {
    const auto& [row, column] = parts[i];
    float* into = C + row.begin + static_cast<std::ptrdiff_t>(column.begin) * stride;
    if (row.begin == column.begin && row.size == column.size)
      ssyrk_("L", "N", &row.size, &width, &kMinusOne, lower + row.begin, &lower_stride, &kOne, into, &stride);
    else
      sgemm_("N", "T", &row.size, &column.size, &width, &kMinusOne, lower + row.begin, &lower_stride,
             lower + column.begin, &lower_stride, &kOne, into, &stride);
  });
}

// The first `columns` of a front [height x columns].
bool factorise_columns(float* front, int height, int columns, bool shared) {
  for (int begin = 0; begin < columns; begin += kPanel) {
    const int width = std::min(kPanel, columns - begin), below = height - begin - width;
    float* diagonal = front + begin + static_cast<std::ptrdiff_t>(begin) * height;
    if (!factorise_diagonal(diagonal, width, height)) return false;
    const std::vector<Span> rows = tiles(0, below);
    for_each(rows.size(), shared, [&](std::size_t i) {
      strsm_("R", "L", "T", "N", &rows[i].size, &width, &kOne, diagonal, &height, diagonal + width + rows[i].begin,
             &height);
    });
    update(diagonal + width, height, width, diagonal + width + static_cast<std::ptrdiff_t>(width) * height, height,
           below, columns - begin - width, shared);
  }
  return true;
}

struct Orders {
  Graph graph;
  std::vector<Index> place;
  int block = 0;
  std::shared_ptr<const Elimination> plan;
};

}  // namespace

Graph graph_of(const SparseMatrix& matrix, int block) {
  Graph graph;
  const auto vertices = static_cast<Index>(matrix.rows() / block);
  std::vector<Index> row;
  for (Index vertex = 0; vertex < vertices; ++vertex) {
    row.clear();
    for (Eigen::Index i = 0; i < block; ++i)
      for (SparseMatrix::InnerIterator entry(matrix, block * static_cast<Eigen::Index>(vertex) + i); entry; ++entry)
        if (const auto other = static_cast<Index>(entry.col() / block); other != vertex) row.push_back(other);
    std::sort(row.begin(), row.end());
    graph.neighbours.insert(graph.neighbours.end(), row.begin(), std::unique(row.begin(), row.end()));
    graph.starts.push_back(static_cast<Index>(graph.neighbours.size()));
  }
  return graph;
}

std::shared_ptr<const Elimination> dissected_elimination(const Graph& graph, int block) {
  static Orders last;
  const bool known = last.plan && last.graph == graph;
  if (known && last.block == block) return last.plan;
  if (!known) last = {graph, nested_dissection(graph), 0, nullptr};
  last.block = block;
  last.plan = std::make_shared<const Elimination>(elimination_of(graph, last.place, block));
  return last.plan;
}

// Workspace of one thread.
struct SingleCholesky::Scratch {
  std::vector<Index> position;  // of each vertex of L in a front
};

SingleCholesky::SingleCholesky(std::shared_ptr<const Elimination> plan, int block)
    : plan_(std::move(plan)), block_(block), original_(plan_->place.size()) {
  std::int64_t size = 0;
  for (const Node& node : plan_->nodes) {
    begins_.push_back(size);
    size += block_ * block_ * node.columns * (node.columns + std::ssize(node.rows));
  }
  factors_.reset(new float[static_cast<std::size_t>(size)]);
  for (std::size_t v = 0; v < original_.size(); ++v) original_[index_of(plan_->place[v])] = static_cast<Index>(v);
  for (std::size_t i = 0; i < plan_->nodes.size(); ++i) {
    const Node& node = plan_->nodes[i];
    const double columns = node.columns, height = columns + static_cast<double>(node.rows.size());
    Subtree subtree{i, columns * height * height, columns * height};
    for (const Index child : node.children) {
      Subtree& below = subtrees_[index_of(child)];
      below.has_parent = true;
      subtree.first = std::min(subtree.first, below.first);
      subtree.operations += below.operations;
      subtree.entries += below.entries;
    }
    subtrees_.push_back(subtree);
  }
  for (const Subtree& subtree : subtrees_) {
    operations_ += subtree.has_parent ? 0 : subtree.operations;
    entries_ += subtree.has_parent ? 0 : subtree.entries;
  }
}

template <typename Work>
void SingleCholesky::visit(Order order, double Subtree::*size, int threads, const Work& work) const {
  double all = 0;
  for (const Subtree& subtree : subtrees_) all += subtree.has_parent ? 0 : subtree.*size;
  // Depth first: few updates wait for their parents at a time.
  const std::function<void(std::size_t)> visit_tree = [&](std::size_t i) {
    const Subtree& subtree = subtrees_[i];
    if (subtree.*size <= kSubtree * all) {
      const std::size_t count = i - subtree.first + 1;
      for (std::size_t k = 0; k < count; ++k) work(order == Order::kChildrenFirst ? subtree.first + k : i - k, false);
      return;
    }
    if (order == Order::kParentsFirst) work(i, true);
    for (const Index child : plan_->nodes[i].children) {
#pragma omp task firstprivate(child)
      visit_tree(index_of(child));
    }
#pragma omp taskwait
    if (order == Order::kChildrenFirst) work(i, true);
  };
#pragma omp parallel num_threads(threads)
#pragma omp single
  for (std::size_t i = 0; i < subtrees_.size(); ++i)
    if (!subtrees_[i].has_parent) visit_tree(i);
}

std::int64_t SingleCholesky::bytes(const Elimination& plan, int block, int threads) {
  std::int64_t largest = 0;
  for (const Node& node : plan.nodes) largest = std::max<std::int64_t>(largest, std::ssize(node.rows));
  const std::int64_t update = block * block * largest * largest;
  return static_cast<std::int64_t>(sizeof(float)) * (block * block * plan.entries() + 2 * threads * update);
}

// The entries of the matrix in a node's columns, and zeros elsewhere.
void SingleCholesky::assemble(std::size_t index, const SparseMatrix& matrix, const Scratch& scratch) const {
  const Node& node = plan_->nodes[index];
  const std::int64_t height = block_ * (node.columns + std::ssize(node.rows));
  float* front = part(index);
  std::fill_n(front, height * block_ * node.columns, 0.0F);
  for (Index c = 0; c < node.columns; ++c)
    for (Index axis = 0; axis < block_; ++axis) {
      const Eigen::Index row = block_ * static_cast<Eigen::Index>(original_[index_of(node.begin + c)]) + axis;
      float* column = front + (block_ * c + axis) * height;
      for (SparseMatrix::InnerIterator entry(matrix, row); entry; ++entry) {
        const auto other = static_cast<std::size_t>(entry.col() / block_);
        if (plan_->place[other] < node.begin) continue;
        column[block_ * scratch.position[index_of(plan_->place[other])] + entry.col() % block_] =
            static_cast<float>(entry.value() * scale_[row] * scale_[entry.col()]);
      }
      column[block_ * c + axis] = 1;
    }
}

// The front of a node: its columns, what children and matrix add to them, and what it leaves for its parent.
bool SingleCholesky::eliminate(std::size_t index, const SparseMatrix& matrix, bool shared, Scratch& scratch,
                               std::vector<std::vector<float>>& updates) const {
  const Node& node = plan_->nodes[index];
  std::vector<Index>& position = scratch.position;
  for (Index c = 0; c < node.columns; ++c) position[index_of(node.begin + c)] = c;
  for (std::size_t i = 0; i < node.rows.size(); ++i)
    position[index_of(node.rows[i])] = node.columns + static_cast<Index>(i);
  assemble(index, matrix, scratch);
  const int columns = block_ * node.columns, below = block_ * static_cast<int>(node.rows.size()),
            height = columns + below;
  float* front = part(index);
  std::vector<float>& rest = updates[index];
  rest.assign(static_cast<std::size_t>(below) * static_cast<std::size_t>(below), 0.0F);
  for (const Index child : node.children) {
    const std::vector<Index>& rows = plan_->nodes[index_of(child)].rows;
    std::vector<float>& update_of_child = updates[index_of(child)];
    const auto size = static_cast<std::ptrdiff_t>(block_) * std::ssize(rows);
    const auto add = [&](std::size_t j) {
      for (Index axis = 0; axis < block_; ++axis) {
        const std::ptrdiff_t column = static_cast<std::ptrdiff_t>(block_) * position[index_of(rows[j])] + axis;
        float* into = column < columns ? front + column * height : rest.data() + (column - columns) * below - columns;
        const float* from = update_of_child.data() + (block_ * static_cast<std::ptrdiff_t>(j) + axis) * size;
        for (std::size_t i = j; i < rows.size(); ++i) {
          const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(block_) * position[index_of(rows[i])];
          for (std::ptrdiff_t a = 0; a < block_; ++a)
            into[row + a] += from[block_ * static_cast<std::ptrdiff_t>(i) + a];
        }
      }
    };
    const std::size_t parts = (rows.size() + kColumns - 1) / kColumns;
    for_each(parts, shared, [&](std::size_t part) {
      for (std::size_t j = part * kColumns; j < std::min(rows.size(), (part + 1) * kColumns); ++j) add(j);
    });
    std::vector<float>().swap(update_of_child);
  }
  if (!factorise_columns(front, height, columns, shared)) return false;
  if (below > 0) update(front + columns, height, columns, rest.data(), below, below, below, shared);
  return true;
}

bool SingleCholesky::factorise(const SparseMatrix& matrix, const std::vector<Eigen::Index>& left_out) {
  scale_ = matrix.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale_.allFinite()) return false;
  for (const Eigen::Index row : left_out) scale_[row] = 0;
  std::vector<std::vector<float>> updates(plan_->nodes.size());
  const int threads = operations_ * block_ * block_ * block_ < kLittleWork ? 1 : blas_callers();
  std::vector<Scratch> scratch(static_cast<std::size_t>(threads), Scratch{std::vector<Index>(original_.size())});
  std::atomic<bool> definite = true;
  visit(Order::kChildrenFirst, &Subtree::operations, threads, [&](std::size_t i, bool shared) {
    Scratch& own = scratch[static_cast<std::size_t>(omp_get_thread_num())];
    if (definite && !eliminate(i, matrix, shared, own, updates)) definite = false;
  });
  return definite;
}

void SingleCholesky::solve(const RowMatrix& B, RowMatrix& X) const {
  X.resize(B.rows(), B.cols());
  const Eigen::Index parts = (B.cols() + kTogether - 1) / kTogether;
  for (Eigen::Index part = 0; part < parts; ++part) {
    const Eigen::Index begin = B.cols() * part / parts, end = B.cols() * (part + 1) / parts;
    solve_some(B, begin, end - begin, X);
  }
}

// Columns of B and X from `begin` on. By columns here are the right-hand sides, `count` numbers in each row of L.
void SingleCholesky::solve_some(const RowMatrix& B, Eigen::Index begin, Eigen::Index count, RowMatrix& X) const {
  const int threads = entries_ * block_ * block_ * static_cast<double>(count) < kLittleWork ? 1 : blas_callers();
  // Numbers of any size fit into single precision where the largest of each column is 1.
  Eigen::ArrayXd sizes = Eigen::ArrayXd::Zero(count);
  const auto place_of = [&](Eigen::Index row) {
    return static_cast<Eigen::Index>(block_) * plan_->place[static_cast<std::size_t>(row / block_)] + row % block_;
  };
  Eigen::MatrixXf x(count, B.rows());
#pragma omp parallel num_threads(threads)
  {
    Eigen::ArrayXd own = Eigen::ArrayXd::Zero(count);
#pragma omp for schedule(static)
    for (Eigen::Index row = 0; row < B.rows(); ++row)
      own = own.max(scale_[row] * B.row(row).segment(begin, count).array().abs().transpose());
#pragma omp critical(single_cholesky_sizes)
    sizes = sizes.max(own);
#pragma omp barrier
#pragma omp single
    sizes = (sizes > 0).select(sizes, 1);
#pragma omp for schedule(static)
    for (Eigen::Index row = 0; row < B.rows(); ++row)
      x.col(place_of(row)) = (scale_[row] * B.row(row).segment(begin, count).transpose().array() / sizes).cast<float>();
  }
  std::vector<Eigen::MatrixXf> updates(plan_->nodes.size());
  visit(Order::kChildrenFirst, &Subtree::entries, threads,
        [&](std::size_t i, bool shared) { solve_down(i, shared, x, updates); });
  visit(Order::kParentsFirst, &Subtree::entries, threads, [&](std::size_t i, bool shared) { solve_up(i, shared, x); });
#pragma omp parallel for schedule(static) num_threads(threads)
  for (Eigen::Index row = 0; row < B.rows(); ++row)
    X.row(row).segment(begin, count) = (scale_[row] * sizes * x.col(place_of(row)).cast<double>().array()).transpose();
}

// L y = b in the columns of a node; what these take from the rows below goes to the parent.
void SingleCholesky::solve_down(std::size_t index, bool shared, Eigen::MatrixXf& x,
                                std::vector<Eigen::MatrixXf>& updates) const {
  const Node& node = plan_->nodes[index];
  const int k = static_cast<int>(x.rows()), columns = block_ * node.columns,
            below = block_ * static_cast<int>(node.rows.size()), height = columns + below;
  Eigen::MatrixXf& rest = updates[index];
  rest.resize(k, below);
  const float* beta = &kZero;
  const auto take_from = [&](Index child) {
    const std::vector<Index>& rows = plan_->nodes[index_of(child)].rows;
    const Eigen::MatrixXf update = std::move(updates[index_of(child)]);
    std::size_t j = 0;
    for (; j < rows.size() && rows[j] < node.begin + node.columns; ++j)
      x.middleCols(static_cast<Eigen::Index>(block_) * rows[j], block_) -=
          update.middleCols(block_ * static_cast<Eigen::Index>(j), block_);
    if (j == rows.size()) return;
    if (beta == &kZero) rest.setZero();
    beta = &kOne;
    for (std::size_t place = 0; j < rows.size(); ++j) {
      while (node.rows[place] != rows[j]) ++place;
      rest.middleCols(block_ * static_cast<Eigen::Index>(place), block_) +=
          update.middleCols(block_ * static_cast<Eigen::Index>(j), block_);
    }
  };
  for (const Index child : node.children) take_from(child);
  float* own = x.col(static_cast<Eigen::Index>(block_) * node.begin).data();
  strsm_("R", "L", "T", "N", &k, &columns, &kOne, part(index), &height, own, &k);
  const std::vector<Span> spans = shared ? tiles(0, below) : std::vector<Span>{{0, below}};
  for_each(spans.size(), shared, [&](std::size_t i) {
    const auto& [begin, size] = spans[i];
    if (size > 0)
      sgemm_("N", "T", &k, &size, &columns, &kOne, own, &k, part(index) + columns + begin, &height, beta,
             rest.col(begin).data(), &k);
  });
}

// L^T x = y in the columns of a node.
void SingleCholesky::solve_up(std::size_t index, bool shared, Eigen::MatrixXf& x) const {
  const Node& node = plan_->nodes[index];
  const int k = static_cast<int>(x.rows()), columns = block_ * node.columns,
            below = block_ * static_cast<int>(node.rows.size()), height = columns + below;
  float* own = x.col(static_cast<Eigen::Index>(block_) * node.begin).data();
  if (below > 0) {
    Eigen::MatrixXf gathered(k, below);
    for (std::size_t j = 0; j < node.rows.size(); ++j)
      gathered.middleCols(block_ * static_cast<Eigen::Index>(j), block_) =
          x.middleCols(static_cast<Eigen::Index>(block_) * node.rows[j], block_);
    const std::vector<Span> spans = shared ? tiles(0, columns) : std::vector<Span>{{0, columns}};
    for_each(spans.size(), shared, [&](std::size_t i) {
      const auto& [begin, size] = spans[i];
      sgemm_("N", "N", &k, &size, &below, &kMinusOne, gathered.data(), &k,
             part(index) + columns + static_cast<std::ptrdiff_t>(begin) * height, &height, &kOne,
             own + static_cast<std::ptrdiff_t>(begin) * k, &k);
    });
  }
  strsm_("R", "L", "N", "N", &k, &columns, &kOne, part(index), &height, own, &k);
}

}  // namespace exmat::precompute
