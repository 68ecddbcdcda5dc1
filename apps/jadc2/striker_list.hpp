// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/peer.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace jadc2 {

/// A node's description of itself, as far as it is needed here.
struct node_description {
    struct offer {
        std::string verb{};
        std::string task{};
    };

    std::vector<offer> tasks{};
};
BOOST_DESCRIBE_STRUCT(node_description::offer, (), (verb, task))
BOOST_DESCRIBE_STRUCT(node_description, (), (tasks))

/// The nodes that offer `strike`, as far as a mission centre knows. It only decides; its caller asks the nodes for
/// their descriptions.
class striker_list {
  public:
    /// How long a node that could not be reached is asked after all others, s.
    static constexpr double avoided_s = 5;
    /// How long a node is not asked for its description after it has not given it, s.
    static constexpr double pause_s = 1;

    /// The other nodes that are known now. Here and below, `now` is in s since 1970.
    /// \return those whose description is wanted; each is wanted again after `failed`, and when its tasks have changed
    std::vector<std::string> update(const std::vector<cles::peer>& known, double now);
    /// A node has described itself.
    void described(const std::string& node, const node_description& by_itself);
    /// It has not.
    void failed(const std::string& node, double now);
    /// It could not be reached.
    void avoid(const std::string& node, double now);

    /// The live nodes that offer `strike`: those that are avoided last, then by the number of orders that they got.
    [[nodiscard]] std::vector<std::string> candidates(double now) const;
    /// It gets an order.
    void gets_order(const std::string& node);

  private:
    struct known_node {
        std::string version{}; ///< of its tasks
        bool live = false;
        bool asked = false;
        bool offers = false;
        double ask_after = 0;
        double avoid_until = 0;
        std::uint64_t orders = 0;
    };

    std::map<std::string, known_node> nodes_;
};

} // namespace jadc2
