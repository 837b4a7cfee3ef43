"""Numbers of robust statistics: deviations and weights that outliers hardly change."""

NORMAL = 1.4826  # standard deviation of a normal distribution over its median distance from the middle
TUKEY = 4.685  # deviations beyond which Tukey's biweight is zero: 95 % efficient without outliers
