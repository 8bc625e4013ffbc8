r"""The statements of `fullam.paper.EQUATIONS` as LaTeX, in the paper's order.

Of AMS only `bmatrix` and `aligned` are used, which Jupyter shows, too.
"""

LATEX: tuple[str, ...] = (
    r"T_{WA} = \begin{bmatrix} R_{WA} & p_{WA} \\ 0 & 1 \end{bmatrix}",
    r"R_{WA} = R_x(\varphi)\, R_y(\psi)\, R_z(\gamma)",
    r"{}^{i-1}A_i = \begin{bmatrix} {}^{i-1}R_i & {}^{i-1}P{}_i \\ 0 & 1 \end{bmatrix}",
    r"{}^{i-1}A_i = \mathrm{Rot}_x(\alpha)\, \mathrm{Trans}_x(a)\, \mathrm{Trans}_z(d)\, "
    r"\mathrm{Rot}_z(\theta)",
    r"{}^{0}T_i = T_{WA}\, {}^{A}T_0 \prod_k {}^{k-1}A_k",
    r"\begin{aligned} p_i &= p_{i-1} + R_{i-1}\, {}^{i-1}P{}_i \\ "
    r"p_i^c &= p_i + R_i\, {}^{i}P{}_i^c \end{aligned}",
    r"\begin{bmatrix} \dot\varphi \\ \dot\psi \\ \dot\gamma \end{bmatrix} = \begin{bmatrix} "
    r"1 & s_\varphi t_\psi & -c_\varphi t_\psi \\ 0 & c_\varphi & s_\varphi \\ "
    r"0 & -s_\varphi / c_\psi & c_\varphi / c_\psi \end{bmatrix} \omega_W",
    r"\omega_i = \omega_{i-1} + R_i Z_0 \dot\theta_i",
    r"\begin{aligned} \dot p_i &= \dot p_{i-1} + \omega_{i-1} \times R_{i-1}\, {}^{i-1}P{}_i \\ "
    r"\dot p_i^c &= \dot p_i + \omega_i \times R_i\, {}^{i}P{}_i^c \end{aligned}",
    r"\dot\omega_i = \dot\omega_{i-1} + \omega_i \times R_i Z_0 \dot\theta_i "
    r"+ R_i Z_0 \ddot\theta_i",
    r"\ddot p_i = \ddot p_{i-1} + \dot\omega_{i-1} \times L "
    r"+ \omega_{i-1} \times (\omega_{i-1} \times L), \quad L = R_{i-1}\, {}^{i-1}P{}_i",
    r"\begin{aligned} I_A \dot\omega_A + \omega_A \times I_A \omega_A "
    r"&= U_\tau - \tau_1 - r_A^{out} \times f_1 \\ "
    r"m_A \ddot p_A &= U_f - f_1 + m_A g \end{aligned}",
    r"\begin{aligned} I_i \dot\omega_i + \omega_i \times I_i \omega_i &= \tau_i "
    r"+ r_i^{in} \times f_i - \tau_{i+1} - r_i^{out} \times f_{i+1} \\ "
    r"m_i \ddot p_i^c &= f_i - f_{i+1} + m_i g \end{aligned}",
    r"I_A^W = R_{WA}\, I_A\, R_{WA}^T",
    r"s(v)\, x = v \times x",
    r"R = 1 + s(v) \sin\theta + s(v)^2 (1 - \cos\theta)",
    r"R_e = R_d R_c^T",
    r"\theta_e v_e = \log(R_e)",
    r"u_{pid} = k_p e + k_i \int e \, dt + k_d \frac{de}{dt}",
    r"u_{dc} = \begin{bmatrix} f_1 - m_A g \\ "
    r"\omega_A \times I_A \omega_A + \tau_1 + r_A^{out} \times f_1 \end{bmatrix}",
    r"\begin{bmatrix} M_A \\ M_1 \\ \vdots \\ M_n \end{bmatrix} X_s = "
    r"\begin{bmatrix} b_A \\ b_1 \\ \vdots \\ b_n \end{bmatrix}",
    r"\begin{aligned} I_A \dot\omega_A + s(r_A^{out}) f_1 + \tau_1 "
    r"&= U_\tau - \omega_A \times I_A \omega_A \\ m_A \ddot p_A + f_1 &= U_f + G_A \end{aligned}",
    r"\text{(24) with } i = 1 \text{ and the platform as link 0}",
    r"\begin{aligned} \dot\omega_i - \dot\omega_{i-1} &= h_i \\ "
    r"\ddot p_i^c - \ddot p_i - s_i^1 \dot\omega_i &= g_i^1 \\ "
    r"\ddot p_i - \ddot p_{i-1} - s_i^2 \dot\omega_{i-1} &= g_i^2 \end{aligned}",
    r"g(\omega, R, P) = \omega \times (\omega \times R P)",
    r"u = \begin{bmatrix} m_A 1 & 0 \\ 0 & I_A \end{bmatrix} u_{pid} + u_{dc}",
    r"f = k_f \Omega_i^2",
    r"F_i = e_i^F k_f \Omega_i^2",
    r"F = k_f e^F \Omega",
    r"\tau_i = r_i \times e_i^F k_f \Omega_i^2 + d_i k_\tau e_i^F \Omega_i^2",
    r"\tau_i = s_\tau(r_i, d_i, k_f, k_\tau)\, e_i^F \Omega_i^2",
    r"s_\tau(r, d, k_f, k_\tau) = s(k_f r) + d k_\tau 1",
    r"\tau = M_\tau \Omega, \quad \text{column } i: s_\tau(r_i, d_i, k_f, k_\tau)\, e_i^F",
    r"\begin{bmatrix} F \\ \tau \end{bmatrix} = \begin{bmatrix} k_f e^F \\ M_\tau \end{bmatrix} "
    r"\Omega",
    r"\begin{bmatrix} U_f \\ U_\tau \end{bmatrix} = \begin{bmatrix} R_A & 0 \\ 0 & R_A "
    r"\end{bmatrix} \begin{bmatrix} k_f e^F \\ M_\tau \end{bmatrix} \Omega",
)
