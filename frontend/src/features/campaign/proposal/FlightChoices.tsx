import { Chip, Group } from "@mantine/core";
import type { Proposal } from "../../../api/types";
import { CHOICES, type ChoiceName } from "./choices";
import classes from "./Proposal.module.css";

interface Props {
  proposal: Proposal;
  chosen: ChoiceName;
  disabled: boolean;
  onChoose: (choice: ChoiceName) => void;
}

/** One choice of what to fly next. */
export function FlightChoices({ proposal, chosen, disabled, onChoose }: Props) {
  const recommended = proposal.choices.find(
    (choice) => choice.recommended && (!choice.proposed || proposal.gate.passed),
  )?.kind;
  return (
    <Chip.Group value={chosen} onChange={(name) => onChoose(name as ChoiceName)}>
      <Group gap={8} role="radiogroup" aria-label="Gains to fly">
        {[...proposal.choices.map(({ kind }) => kind), "own" as const].map((name) => (
          <Chip
            key={name}
            name="gains-to-fly"
            value={name}
            disabled={disabled}
            variant="outline"
            classNames={{ label: classes["choice"] }}
          >
            {CHOICES[name].label}
            {name === recommended && " (recommended)"}
          </Chip>
        ))}
      </Group>
    </Chip.Group>
  );
}
