// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/virtual_environment.hpp"

#include <cles/error.hpp>

#include "simulation/network/datagram_port.hpp"
#include "simulation/network/group_port.hpp"
#include "simulation/network/stream_half.hpp"
#include "simulation/world/node_run.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {

using std::chrono::milliseconds;

/// A listener of a node, independent of the transport.
class virtual_environment::door final : public acceptor {
  public:
    door(url where, std::function<void(const on_link&)> open, std::function<void()> shut)
        : where_(std::move(where)), open_(std::move(open)), shut_(std::move(shut)) {}
    ~door() override { shut_(); }
    [[nodiscard]] url local() const override { return where_; }
    void start(on_link arrived) override { open_(arrived); }
    void close() override { shut_(); }

  private:
    url where_;
    std::function<void(const on_link&)> open_;
    std::function<void()> shut_;
};

// -- time and tasks --------------------------------------------------------------------------------------------------

time_point virtual_environment::now() const {
    return shown_ ? *shown_ : process_ != nullptr ? process_->now() : net_.time().now();
}

void virtual_environment::post(std::shared_ptr<core::task> next) {
    if (discards_) {
        next->discard();
        return;
    }
    tasks_.push_back(std::move(next));
    if (process_ != nullptr) {
        process_->later({}, [this] { run_next(); });
    }
}

void virtual_environment::run_next() {
    if (process_ != nullptr && !tasks_.empty()) {
        const auto next = std::move(tasks_.front());
        tasks_.pop_front();
        next->run();
    }
}

void virtual_environment::discard_tasks() {
    discards_ = true;
    while (!tasks_.empty()) {
        const auto next = std::move(tasks_.front());
        tasks_.pop_front();
        next->discard();
    }
}

void virtual_environment::set_timer(time_point due) {
    if (on_due_) {
        due_ = due;
        arm_timer();
    }
}

void virtual_environment::arm_timer() {
    ++timer_;
    if (process_ == nullptr || !due_) {
        return;
    }
    constexpr milliseconds too_late{20};
    const auto when = net_.fault() == planted::timer_late ? *due_ + too_late : *due_;
    process_->at(when, [this, mine = timer_] {
        if (mine == timer_ && process_ != nullptr && on_due_) {
            on_timer();
        }
    });
}

void virtual_environment::on_timer() {
    const auto due = *std::exchange(due_, std::nullopt);
    if (net_.fault() == planted::excuse_forgotten) { // the node processes the time in which it was stopped
        constexpr milliseconds step{400};
        for (auto shown = due; process_ != nullptr && shown < process_->now(); shown += step) {
            run_timer_as_if(shown);
        }
    }
    run_timer();
}

void virtual_environment::run_timer() {
    if (process_ != nullptr && on_due_) {
        const auto call = on_due_; // which may stop it
        call();
    }
}

void virtual_environment::run_timer_as_if(time_point shown) {
    shown_ = shown;
    run_timer();
    shown_.reset();
}

// -- links -----------------------------------------------------------------------------------------------------------

bool virtual_environment::has_transport(std::string_view scheme) const {
    return scheme == (net_.secured() ? "tls" : "tcp") || scheme == "udp" || scheme == "inproc";
}

std::unique_ptr<acceptor> virtual_environment::listen(const url& where, const limits& bounds) {
    if (where.scheme == "inproc") { // no other node shares this environment
        return std::make_unique<door>(
            where, [](const on_link&) {}, [] {});
    }
    const auto at = endpoint_of(where);
    if (where.scheme != "udp") {
        const auto open = [this, at, bounds](const on_link& arrived) {
            net_.listen(at, process_->shared_from_this(), bounds, [this, arrived](const network::stream_ptr& made) {
                remember(made, true);
                if (auto* const own = process_->security()) {
                    made->open(*own, {}, {});
                }
                arrived(made);
            });
        };
        return std::make_unique<door>(where, open, [this, at] {
            if (process_ != nullptr) {
                net_.shut(at);
            }
        });
    }
    const auto port = make_port(at, strangers_);
    const auto open = [this, port](const on_link& arrived) {
        port->accept([this, arrived](const link_ptr& made) {
            remember(made, true);
            arrived(made);
        });
        port->open();
    };
    return std::make_unique<door>(where, open, [port] { port->accept(nullptr); });
}

std::shared_ptr<datagram_port> virtual_environment::make_port(const endpoint& at, bool strangers) {
    auto* const own = process_->security();
    auto made = std::make_shared<datagram_port>(net_, process_->shared_from_this(), at, strangers,
                                                own != nullptr ? own->make_codec() : nullptr);
    std::erase_if(ports_, [](const auto& each) { return each.expired(); });
    ports_.push_back(made);
    return made;
}

std::function<void()> virtual_environment::dial(const url& where, std::string_view name, const limits& bounds,
                                                dial_callback done) {
    auto wanted = std::make_shared<bool>(true);
    const auto to = endpoint_of(where);
    auto arrive = [this, wanted, done = std::move(done)](boost::system::error_code code, const link_ptr& made) {
        if (!*wanted || process_ == nullptr) {
            if (made) {
                made->close();
            }
            return;
        }
        if (made) {
            remember(made, false);
        }
        done(code, made);
    };
    if (process_ == nullptr) {
        return [] {};
    }
    auto* const own = process_->security();
    if (where.scheme != "udp") {
        net_.dial(process_->shared_from_this(), to, bounds,
                  [this, own, expected = std::string{name},
                   arrive = std::move(arrive)](boost::system::error_code code, const network::stream_ptr& made) {
                      if (!made || own == nullptr || process_ == nullptr) {
                          arrive(code, made);
                          return;
                      }
                      remember(made, false);
                      made->open(*own, expected, [arrive, made](bool admitted) {
                          if (admitted) {
                              arrive({}, made);
                          } else {
                              arrive(make_error_code(errc::unavailable), nullptr);
                          }
                      });
                  });
    } else {
        process_->later({}, [this, own, to, expected = std::string{name}, arrive = std::move(arrive)] {
            const auto member = own != nullptr && process_ != nullptr ? own->number_of(expected) : 0;
            if (own != nullptr && member == 0) {
                arrive(make_error_code(errc::unavailable), nullptr);
            } else if (process_ != nullptr) {
                const auto port = make_port({process_->host(), net_.free_port(process_->host())}, false);
                port->open();
                arrive({}, port->connect(to, member));
            }
        });
    }
    return [wanted] { *wanted = false; };
}

void virtual_environment::remember(const link_ptr& made, bool incoming) {
    std::erase_if(links_, [](const auto& each) { return each.first.expired(); });
    links_.emplace_back(made, incoming);
}

std::size_t virtual_environment::most_held() const {
    std::size_t most = 0;
    for (const auto& [weak, incoming] : links_) {
        const auto stream = std::dynamic_pointer_cast<stream_half>(incoming ? weak.lock() : nullptr);
        most = stream ? std::max(most, stream->held()) : most;
    }
    return most;
}

// -- the multicast group ---------------------------------------------------------------------------------------------

core::network_interface virtual_environment::find_interface(const std::string& name) {
    return {.name = name,
            .index = 1,
            .address = address_of(process_->host()),
            .loopback = false,
            .running = true,
            .multicast = true};
}

std::shared_ptr<core::group_port> virtual_environment::join(const core::network_interface&, const multicast_options&) {
    group_ = std::make_shared<group_port>(net_, *process_);
    return group_;
}

// -- the end ---------------------------------------------------------------------------------------------------------

void virtual_environment::end() {
    if (process_ == nullptr) {
        return;
    }
    net_.close_doors(process_->host());
    process_ = nullptr;
    for (const auto& weak : ports_) {
        if (const auto port = weak.lock()) {
            port->end();
        }
    }
    on_due_ = nullptr;
    for (const auto& [weak, incoming] : std::exchange(links_, {})) {
        if (const auto open = weak.lock()) {
            open->output().clear();
            open->urgent_output().clear();
            open->close();
        }
    }
    if (group_) {
        group_->close();
    }
}

} // namespace cles::simulation
