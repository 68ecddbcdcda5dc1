// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/limits.hpp>

#include "core/gossip_answers.hpp"
#include "core/peer_report.hpp"
#include "core/presence.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

/// Tables of nodes as they cross a link, both directions (docs/protocol.md, "Gossip").

namespace cles::core {

/// What an answer with news may have, on a stream.
inline constexpr std::size_t table_page = 32 * 1024;
/// How many entries count that are told unasked.
inline constexpr std::size_t most_told = 64;

/// Who answers.
struct table_owner {
    std::string_view node;
    std::string_view epoch; ///< as text
};
/// Writes the reply, of `longest` bytes at most with its head.
void write_news(json_writer& w, const table_owner& who, const presence& others, const table_question& asked,
                std::size_t longest, time_point now);

/// Writes the body of `PUSH self:cles/peers` by which a node tells of itself.
void write_own_entry(json_writer& w, const announcement& said, std::string_view epoch, std::uint64_t seq,
                     std::chrono::milliseconds age);

/// Takes what is read from a table.
class table_reader {
  public:
    table_reader() = default;
    table_reader(const table_reader&) = delete;
    table_reader& operator=(const table_reader&) = delete;
    virtual void on_report(const peer_report& report) = 0;
    virtual void on_beat(const peer_beat& beat) = 0;
    /// An entry that cannot be read, and is passed over.
    virtual void on_bad_entry() = 0;

  protected:
    ~table_reader() = default;
};

/// What is said around the entries.
struct table_head {
    std::string node;  ///< who answers; empty where that is not said
    std::string epoch; ///< as text
    std::string pool;  ///< to which that one belongs
    std::string next;  ///< empty: the table is whole, and is so each time
    bool more = false;
};

/// Reads an answer, or what is told unasked. False where it is no table; entries before the mistake have been handed
/// over.
bool read_table(std::string_view json, std::size_t most_entries, table_reader& to, table_head& head);

/// Reads the reply to `PULL self:cles` as far as it says who that is and where. False where it does not.
bool read_description(std::string_view json, peer_report& out);

} // namespace cles::core
