// The lab page fed by a synthetic device, to look at it without the program.

import "./mock";
import "../lab/main";
