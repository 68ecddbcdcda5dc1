// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "commander.hpp"
#include "events.hpp"
#include "feed_watch.hpp"
#include "operator_command.hpp"
#include "order_desk.hpp"
#include "order_round.hpp"
#include "story.hpp"
#include "strike/order.hpp"
#include "striker_list.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <csignal>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace jadc2 {

struct mission_options {
    std::string name = "mission";
    std::string recon_name = "recon";
    std::string recon = "tcp://127.0.0.1:25373";
    std::vector<std::string> strikers{"tcp://127.0.0.1:25374"};
    std::uint64_t strikes = 1;    ///< number of strikes after which it ends
    double oldest_s = 2;          ///< of a picture on which an order is based
    double age_s = 0.6;           ///< for which a target must have been followed before the script strikes
    std::uint64_t every_ms = 250; ///< the minimum interval between pictures of the tracks
    bool has_operator = false;    ///< an operator at the terminal decides; otherwise a script does
    std::string audit{};          ///< the file that keeps all that happened; empty: none
    double duration_s = 0;        ///< after which it ends in any case; 0: no limit
    std::uint64_t deadline_ms = 3000;
    std::string keys{}; ///< the directory with its key; empty: without security
    bool json = false;
};

/// The mission centre: it binds to the tracks of the reconnaissance aircraft, lets an operator decide, and delegates
/// the strike to a node that offers it: by name, so that each is asked once, whether orders are signed or not. A plain
/// service, which does not listen.
class mission {
  public:
    explicit mission(const mission_options& args);

    /// Runs until all strikes have ended, or it is stopped. \return the exit code
    int run();

  private:
    /// An order that has been given and has not ended.
    struct open_order {
        strike::order what{};
        story record{};
        order_round round;
        double sent_utc = 0;
        std::chrono::steady_clock::time_point sent{};
        std::string node{};   ///< that has it now
        bool aborted = false; ///< it goes to no other node
    };

    boost::asio::awaitable<void> watch();
    boost::asio::awaitable<void> search();
    boost::asio::awaitable<void> describe(std::string node);
    boost::asio::awaitable<void> watch_feed();
    boost::asio::awaitable<void> follow(cles::feed<picture> tracks);
    boost::asio::awaitable<void> read_orders();
    void tell(const story& record);
    boost::asio::awaitable<void> give(std::shared_ptr<open_order> one);
    boost::asio::awaitable<void> offer(std::shared_ptr<open_order> one, std::string node);
    boost::asio::awaitable<void> assess(story record);
    void see(picture what);
    [[nodiscard]] std::string objection_to(const fmv::track& target, bool again) const;
    void decide(const fmv::track& target, bool again);
    void run_command(std::string_view line);
    void read_back(const operator_command& order);
    void confirm();
    void abort();
    boost::asio::awaitable<void> withdraw(std::shared_ptr<open_order> one);
    void show();
    void report_error(const std::string& text);
    void end();
    void end_if_done();
    [[nodiscard]] std::string explain_no_striker() const;

    mission_options args_;
    event_log events_;
    boost::asio::io_context io_{1};
    cles::service node_;
    boost::asio::signal_set signals_{io_, SIGINT, SIGTERM};
    boost::asio::steady_timer pause_{io_};
    boost::asio::steady_timer search_pause_{io_};
    boost::asio::steady_timer feed_pause_{io_};
    boost::asio::steady_timer limit_{io_};
    boost::asio::posix::stream_descriptor keyboard_{io_};
    commander commander_;
    striker_list strikers_;
    feed_watch feed_;
    order_desk desk_;
    std::vector<std::weak_ptr<open_order>> given_; ///< those that may be open
    std::string run_;                              ///< unique: part of the names of orders
    std::string error_;                            ///< reported last
    double received_utc_ = 0;                      ///< of the newest picture
    double shown_utc_ = 0;
    std::uint64_t watched_ = 0;  ///< impacts that are still to come
    bool operator_gone_ = false; ///< no more orders are given
    bool ending_ = false;
};

} // namespace jadc2
