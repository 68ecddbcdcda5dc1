// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/virtual_environment.hpp"

#include "simulation/network/datagram_port.hpp"
#include "simulation/network/group_port.hpp"
#include "simulation/network/stream_half.hpp"
#include "simulation/world/node_run.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {

using std::chrono::milliseconds;

/// No other node shares this environment.
class virtual_environment::local_acceptor final : public acceptor {
  public:
    explicit local_acceptor(url where) : where_(std::move(where)) {}
    [[nodiscard]] url local() const override { return where_; }
    void start(std::function<void(link_ptr)>) override {}
    void close() override {}

  private:
    url where_;
};

class virtual_environment::stream_acceptor final : public acceptor {
  public:
    stream_acceptor(virtual_environment& by, url where, const limits& bounds)
        : by_(by), where_(std::move(where)), bounds_(bounds) {}
    ~stream_acceptor() override { shut(); }
    [[nodiscard]] url local() const override { return where_; }
    void start(std::function<void(link_ptr)> on_link) override {
        by_.net_.listen(
            endpoint_of(where_), by_.process_->shared_from_this(), bounds_,
            [by = &by_, on_link = std::move(on_link)](const link_ptr& made) { by->accepted(on_link, made); });
    }
    void close() override { shut(); }

  private:
    void shut() {
        if (by_.process_ != nullptr) {
            by_.net_.shut(endpoint_of(where_));
        }
    }

    virtual_environment& by_;
    url where_;
    limits bounds_;
};

class virtual_environment::datagram_acceptor final : public acceptor {
  public:
    datagram_acceptor(virtual_environment& by, url where)
        : by_(by), where_(std::move(where)),
          port_(std::make_shared<datagram_port>(by.net_, by.process_->shared_from_this(), endpoint_of(where_),
                                                by.strangers_)) {}
    ~datagram_acceptor() override { port_->accept(nullptr); }
    [[nodiscard]] url local() const override { return where_; }
    void start(std::function<void(link_ptr)> on_link) override {
        port_->accept([by = &by_, on_link = std::move(on_link)](const link_ptr& made) { by->accepted(on_link, made); });
        port_->open();
    }
    void close() override { port_->accept(nullptr); }

  private:
    virtual_environment& by_;
    url where_;
    std::shared_ptr<datagram_port> port_;
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
    const auto call = on_due_;
    if (net_.fault() == planted::excuse_forgotten) { // the node goes through the time in which it was stopped
        constexpr milliseconds step{400};
        for (auto shown = due; shown < process_->now() && on_due_; shown += step) {
            shown_ = shown;
            call();
        }
        shown_.reset();
    }
    if (process_ != nullptr && on_due_) {
        call();
    }
}

// -- links -----------------------------------------------------------------------------------------------------------

bool virtual_environment::has_transport(std::string_view scheme) const {
    return scheme == "tcp" || scheme == "udp" || scheme == "inproc";
}

std::unique_ptr<acceptor> virtual_environment::listen(const url& where, const limits& bounds) {
    if (where.scheme == "tcp") {
        return std::make_unique<stream_acceptor>(*this, where, bounds);
    }
    if (where.scheme == "udp") {
        return std::make_unique<datagram_acceptor>(*this, where);
    }
    return std::make_unique<local_acceptor>(where);
}

void virtual_environment::accepted(const std::function<void(link_ptr)>& on_link, const link_ptr& made) {
    remember(made);
    if (const auto stream = std::dynamic_pointer_cast<stream_half>(made)) {
        std::erase_if(streams_in_, [](const auto& each) { return each.expired(); });
        streams_in_.push_back(stream);
    }
    on_link(made);
}

std::function<void()> virtual_environment::dial(const url& where, const limits& bounds, dial_callback done) {
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
            remember(made);
        }
        done(code, made);
    };
    if (process_ == nullptr) {
        return [] {};
    }
    if (where.scheme == "tcp") {
        net_.dial(process_->shared_from_this(), to, bounds, std::move(arrive));
    } else {
        process_->later({}, [this, to, arrive = std::move(arrive)] {
            if (process_ != nullptr) {
                const endpoint local{process_->host(), net_.free_port(process_->host())};
                const auto port = std::make_shared<datagram_port>(net_, process_->shared_from_this(), local, false);
                port->open();
                arrive({}, port->connect(to));
            }
        });
    }
    return [wanted] { *wanted = false; };
}

void virtual_environment::remember(const link_ptr& made) {
    std::erase_if(links_, [](const auto& each) { return each.expired(); });
    links_.push_back(made);
}

std::size_t virtual_environment::most_held() const {
    std::size_t most = 0;
    for (const auto& each : streams_in_) {
        const auto stream = each.lock();
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
    on_due_ = nullptr;
    for (const auto& each : std::exchange(links_, {})) {
        if (const auto open = each.lock()) {
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
