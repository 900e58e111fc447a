import { Box } from "@mantine/core";
import { IconOctagonFilled } from "@tabler/icons-react";
import { ABORT_LABELS, type AbortControl, type AbortStage } from "../live/flights";
import classes from "./AbortButton.module.css";

interface Props {
  trialId: number;
  stage: AbortStage;
  abort: AbortControl;
  /** As the only action of its page. */
  isLarge?: boolean;
}

/** Aborts without confirmation. */
export function AbortButton({ trialId, stage, abort, isLarge = false }: Props) {
  return (
    <button
      type="button"
      className={classes[isLarge ? "large" : "abort"]}
      data-stage={stage}
      onClick={() => abort.press([trialId])}
    >
      <IconOctagonFilled size={isLarge ? 40 : 20} aria-hidden />
      {ABORT_LABELS[stage]}
      {stage === "none" && (
        <Box component="kbd" fw={550} visibleFrom="sm">
          Space
        </Box>
      )}
    </button>
  );
}
