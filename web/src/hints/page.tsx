import { PageTitle } from "../ui/pieces";
import { t } from "../texts";

export function HintsPage({ id }: { id: string }) {
    return <PageTitle title={`${t.hints.title} ${id}`} />;
}
